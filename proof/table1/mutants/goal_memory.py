"""Mutants that remember goals wrongly, and functions that read goals from requests and from the robot."""

import json
import math
from typing import Any

from proof.mutation.changes import parsed, plain, problem, rest, success
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.crowd import later
from proof.table1.mutants.paths import GOAL, LINEAR, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-resources", "rest")

_GET, _PUT, _DELETE = rest("GET", GOAL), rest("PUT", GOAL), rest("DELETE", GOAL)


def identity(request: Request) -> str | None:
    """Return the goal id in the request, or None."""
    value = parsed(request.body)
    try:
        return str(value["goal_id"]["id"])
    except (TypeError, KeyError):
        return None


def active(forward: Forward, request: Request) -> Any:
    """Request the robot's active goal; return None without one."""
    response = forward(
        request.copy(
            method="GET", target=GOAL, body=b"", fields=[("Host", "localhost"), ("Accept", "application/json")]
        )
    )
    return parsed(response.body) if response.status == 200 else None


def pose_of(goal: Any) -> Any:
    """Return the pose in a MoveBaseActionGoal as floats, or None if it has none."""
    try:
        pose = goal["goal"]["target_pose"]["pose"]
        return {part: {axis: float(pose[part][axis]) for axis in pose[part]} for part in ("position", "orientation")}
    except (TypeError, KeyError, ValueError):
        return None


@_mutant("goal-lingers", "goal-ended", "GET goes on returning a goal that has ended.")
class _Lingering:
    def __init__(self) -> None:
        self._last: Response | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if _DELETE(request):
            self._last = None
        if _GET(request):
            if response.status == 200:
                self._last = response.copy()
            elif self._last is not None and response.status == 404:
                return self._last.copy()
        return response


@_mutant("goal-get-stale", "goal-preempt", "GET returns the previous goal.")
class _Previous:
    def __init__(self) -> None:
        self._seen: list[Any] = []

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        value = parsed(response.body)
        if _GET(request) and response.status == 200 and isinstance(value, dict):
            if not self._seen or self._seen[-1]["goal_id"] != value["goal_id"]:
                self._seen.append(value)
            if len(self._seen) > 1:
                response.body = json.dumps(self._seen[-2]).encode()
        return response


@_mutant("goal-resumed", "goal-drives", "The robot drives to a replaced goal after it has reached the new one.")
class _Resumed:
    def __init__(self) -> None:
        self._last: Request | None = None
        self._displaced: Request | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        if _PUT(request):
            there = forward(request.copy(method="GET", body=b"")).status == 200
            response = forward(request)
            if success(response):
                self._displaced = self._last if there else None
                self._last = request.copy()
            return response
        response = forward(request)
        if not _GET(request):
            self._displaced = None if request.method == "DELETE" else self._displaced
        elif response.status == 404 and self._displaced is not None:
            resumed, self._displaced = self._displaced, None
            forward(resumed.copy())
            return forward(request)
        return response


@_mutant("goal-turn-skipped", "goal-drives", "The robot ends a goal at the place of the last one without turning.")
class _NoTurn:
    def __init__(self) -> None:
        self._there: Any = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        value: Any = parsed(request.body) if _PUT(request) else None
        there = pose_of(value)
        if there is not None and self._there is not None and there["position"] == self._there["position"]:
            value["goal"]["target_pose"]["pose"]["orientation"] = self._there["orientation"]
            request = request.copy(body=json.dumps(value).encode())
        elif there is not None:
            self._there = there
        return forward(request)


@_mutant("goal-id-only-once", "goal-id-again", "The robot refuses a goal with the id of a goal that has ended.")
class _OnlyOnce:
    def __init__(self) -> None:
        self._used: set[str] = set()

    def __call__(self, request: Request, forward: Forward) -> Response:
        id_ = identity(request) if _PUT(request) else None
        if id_ is not None and id_ in self._used and active(forward, request) is None:
            return problem(409, f"goal_id.id: {id_!r} was used before")(request)
        response = forward(request)
        if id_ is not None and success(response):
            self._used.add(id_)
        return response


@_mutant("goal-cancelled-for-good", "goal-id-again", "PUT of a goal with a cancelled goal's id returns 200, no more.")
class _CancelledForGood:
    def __init__(self) -> None:
        self._last = ""
        self._cancelled: set[str] = set()

    def __call__(self, request: Request, forward: Forward) -> Response:
        id_ = (identity(request) or "") if _PUT(request) else ""
        if id_ in self._cancelled:
            return plain(200)(request)
        response = forward(request)
        if id_ and success(response):
            self._last = id_
        elif _DELETE(request) and success(response) and self._last:
            self._cancelled.add(self._last)
        return response


@_mutant(
    "goal-replaced-for-good", "goal-put", "PUT of a goal whose id a replaced goal had returns 200 and changes nothing."
)
class _ReplacedForGood:
    def __init__(self) -> None:
        self._replaced: set[str] = set()
        self._current: str | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        id_ = identity(request) if _PUT(request) else None
        if id_ is not None and id_ in self._replaced:
            return plain(204)(request)
        response = forward(request)
        if _PUT(request) and success(response):
            if self._current is not None and self._current != id_:
                self._replaced.add(self._current)
            self._current = id_
        elif _DELETE(request):
            self._replaced, self._current = set(), None
        return response


@_mutant("goal-id-folded", "goal-id", "Goal ids that differ in upper and lower case are one.")
def _fold_case(request: Request, forward: Forward) -> Response:
    id_ = identity(request) if _PUT(request) else None
    known = active(forward, request) if id_ is not None else None
    shown = str(known["goal_id"]["id"]) if known else None
    if id_ is not None and shown is not None and id_ != shown and id_.lower() == shown.lower():
        return plain(204)(request)
    return forward(request)


@_mutant("goal-dropped-by-refusal", "goal-get", "A velocity that is refused ends the goal.")
def _dropped_by_refusal(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if rest("PUT", VELOCITY, LINEAR)(request) and 400 <= response.status < 500:
        fields = [("Host", "localhost"), ("Connection", "close")]
        forward(request.copy(method="DELETE", target=GOAL, body=b"", fields=fields))
    return response


@_mutant("goal-conflict-by-place-alone", "goal-conflict", "Another heading under the active goal's id is a repetition.")
def _by_place(request: Request, forward: Forward) -> Response:
    id_ = identity(request) if _PUT(request) else None
    known = active(forward, request) if id_ is not None else None
    if known and str(known["goal_id"]["id"]) == id_:
        wanted, shown = pose_of(parsed(request.body)), pose_of(known)
        if wanted is not None and shown is not None and wanted["position"] == shown["position"]:
            return plain(204)(request)
    return forward(request)


@_mutant("goal-abandoned", "goal-drives", "The robot aborts the goal before it arrives.")
class _Abandoned:
    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if _PUT(request) and response.status in {201, 202}:
            fields = [("Host", "localhost"), ("Connection", "close")]
            later(0.4, forward, request.copy(method="DELETE", body=b"", fields=fields))
        return response


@_mutant(
    "goal-unreachable-forever", "goal-unreachable", "The robot accepts a goal far outside the map, which stays active."
)
class _Unreachable:
    def __init__(self) -> None:
        self._goal: Any = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        if request.path != GOAL or request.side != "rest":
            return forward(request)
        if _PUT(request):
            value = parsed(request.body)
            pose = pose_of(value)
            far = pose is not None and max(abs(pose["position"][axis]) for axis in "xy") > 90
            self._goal = None
            if far and math.isfinite(sum(pose["position"].values())):
                header = {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "map"}
                status_ = {"code": 2, "text": "on my way"}
                self._goal = {
                    "header": header,
                    "goal_id": {"stamp": header["stamp"], "id": identity(request) or "far"},
                    "goal": value["goal"],
                    "status": status_,
                }
                value["goal"]["target_pose"]["header"].setdefault("stamp", header["stamp"])
                return _reply(202, self._goal, request)
        if _DELETE(request) and self._goal is not None:
            self._goal = None
            return plain(204)(request)
        if _GET(request) and self._goal is not None:
            return _reply(200, self._goal, request)
        return forward(request)


def _reply(status_: int, value: Any, request: Request) -> Response:
    return Response(
        status_,
        [("Content-Type", "application/json"), ("Vary", "Accept")],
        json.dumps(value).encode(),
        method=request.method,
    )
