"""Mutants whose subscribers service returns wrong values, plans or elements."""

import re
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import posted, problem, rest, soap
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, named, says
from conformance.packs.table1.mutants.paths import GOAL

MUTANTS = Table()
_mutant = MUTANTS.of_class("soap-subscribers", "soap")

_POSE, _VELOCITY, _PLAN = soap("GetPose"), soap("GetVelocity"), soap("GetPlan")
_SMALL = 32 * 1024


def _first_is(parent: str, child: str, value: str) -> Callable[[Any], None]:
    return each(parent, each(child, says(value), slice(1)), slice(1))


def _swapped(root: Any) -> None:
    for node in named(root, "position"):
        node[:2] = [node[1], node[0]]


def _reversed_path(root: Any) -> None:
    poses = named(root, "poses")
    if len(poses) > 1:
        parent = poses[0].getparent()
        for pose in poses:
            parent.remove(pose)
        parent.extend(reversed(poses))


def _elsewhere(request: Request) -> None:
    request.body = re.sub(rb"(<(?:\w+:)?x>)[^<]*", rb"\g<1>7.5", request.body)


def _in_map(request: Request) -> None:
    request.body = request.body.replace(b"no_such_frame", b"map")


_mutant("soap-small-questions", "size", "A message over 32 KiB returns 413.").instead(
    lambda request: posted(request) and len(request.body) > _SMALL, problem(413, "too large")
)


@_mutant("soap-goal-lingers", "equivalence/goal", "GetGoal returns a goal that was reached.", interface="both")
class _Lingering:
    def __init__(self) -> None:
        self._last: Response | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if rest("DELETE PUT", GOAL)(request):
            self._last = None
        if soap("GetGoal")(request):
            if b"target_pose" in response.body:
                self._last = response.copy()
            elif self._last is not None:
                return self._last.copy()
        return response


@_mutant("soap-plan-from-the-first-place", "plan", "GetPlan starts where the robot was when it was called first.")
class _FirstPlace:
    def __init__(self) -> None:
        self._start = b""

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not _PLAN(request) or b"start_x" in request.body:
            return forward(request)
        request = request.copy(body=re.sub(rb"(?=</(\w+:)?GetPlan>)", self._start, request.body))
        response = forward(request)
        found = re.search(rb"<poses>.*?<x>(.*?)</x>.*?<y>(.*?)</y>", response.body, re.DOTALL)
        if not self._start and found:
            self._start = b"<start_x>%s</start_x><start_y>%s</start_y>" % found.groups()
        return response
