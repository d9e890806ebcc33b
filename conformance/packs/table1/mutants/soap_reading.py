"""Robots whose subscribers service gives wrong values, wrong plans, or values in a wrong form."""

import re
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import altered, instead, posted, problem, rewritten, soap, text
from conformance.mutation.messages import Request
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.xml_trees import each, gone, named, says, tree

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


_mutant = of_class("soap-subscribers", "soap")

MUTANTS = (
    _mutant(
        "soap-pose-not-unit",
        "GetPose's quaternion is three long.",
        "pose",
        altered(_POSE, tree(_first_is("orientation", "w", "3.0"))),
    ),
    _mutant(
        "soap-velocity-nan",
        "GetVelocity says NaN.",
        "velocity",
        altered(_VELOCITY, tree(_first_is("linear", "x", "NaN"))),
    ),
    _mutant(
        "soap-sensors-short-types",
        "GetSensors names types without their kind.",
        "sensors",
        altered(soap("GetSensors"), text("/msg/", "/")),
    ),
    _mutant("soap-read-order", "Responses have y before x.", "response-valid", altered(_POSE, tree(_swapped))),
    _mutant(
        "soap-read-empty",
        "Responses hold nothing that a client finds.",
        "interop",
        altered(soap("Get[A-Z][A-Za-z]+"), tree(each("return", gone))),
    ),
    _mutant("soap-plan-reversed", "GetPlan gives the way back.", "plan", altered(_PLAN, tree(_reversed_path))),
    _mutant(
        "soap-plan-other-frame",
        "GetPlan's path is in another frame.",
        "plan",
        altered(_PLAN, tree(each("frame_id", says("base_link")))),
    ),
    _mutant("soap-plan-elsewhere", "GetPlan plans to another place.", "plan", rewritten(_PLAN, _elsewhere)),
    _mutant("soap-plan-any-frame", "GetPlan takes any frame for map.", "plan-none", rewritten(_PLAN, _in_map)),
    _mutant(
        "soap-small-questions",
        "A question over 32 KiB is 413.",
        "size",
        instead(lambda request: posted(request) and len(request.body) > _SMALL, problem(413, "too large")),
    ),
)
