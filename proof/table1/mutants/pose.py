"""Mutants that return wrong poses and plans."""

import copy
import math
import operator
import time
from collections.abc import Callable
from typing import Any

from proof.mutation.changes import JSON, parsed, problem, rest, values
from proof.mutation.fields import field
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import LINEAR, PLAN, POSE, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-resources", "rest")

_AT = rest("GET", POSE)
_X, _Y, _ORIENTATION = "pose.pose.position.x", "pose.pose.position.y", "pose.pose.orientation"
_SEC, _NANOSEC = "header.stamp.sec", "header.stamp.nanosec"


def turn(change: Callable[[float], float]) -> Callable[[Any], Any]:
    """Return a function that changes the heading of an orientation, rad."""

    def edit(q: Any) -> Any:
        yaw = change(2 * math.atan2(q["z"], q["w"]))
        return {**q, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}

    return edit


class _Frozen:
    """A change that returns some parts of the first odometry for ever."""

    def __init__(self, *parts: str) -> None:
        self._parts = parts
        self._first: Any = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        value = parsed(response.body) if _AT(request) and response.status == 200 else None
        if isinstance(value, dict):
            self._first = self._first or copy.deepcopy(value)
            values(lambda now: now.update({part: self._first[part] for part in self._parts}))(response)
        return response


@_mutant(
    "velocity-stale-once", "velocity-odometry", "The first GET of the velocity after 0.5 s returns the previous one."
)
class _Stale:
    def __init__(self) -> None:
        self._last: Response | None = None
        self._at = -math.inf

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if not rest("GET", VELOCITY)(request) or not _is_json(request) or response.status != 200:
            return response
        now, last = time.monotonic(), self._last
        is_late, self._at, self._last = now > self._at + 0.5, now, response.copy()
        return last if last is not None and is_late else response


@_mutant("odometry-lost", "pose-fresh", "When the odometry stops, GET returns the last pose and velocity for ever.")
class _Lost:
    def __init__(self) -> None:
        self._left = 60
        self._last: dict[str, Response] = {}

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not rest("GET", POSE, VELOCITY, LINEAR)(request) or not _is_json(request):
            return forward(request)
        if not self._left and request.path in self._last:
            return self._last[request.path].copy()
        response = forward(request)
        if response.status == 200:
            self._left = max(0, self._left - 1)
            self._last[request.path] = response.copy()
        return response


def _is_json(request: Request) -> bool:
    return (request.field("Accept") or JSON) == JSON


@_mutant("pose-clock-fast", "pose-clock", "The clock of the odometry stamps runs 10 % fast.")
class _FastClock:
    def __init__(self) -> None:
        self._begun = time.monotonic()

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if _AT(request) and response.status == 200:
            values(self._later)(response)
        return response

    def _later(self, odometry: Any) -> None:
        stamp = odometry["header"]["stamp"]
        ahead = stamp["sec"] * 10**9 + stamp["nanosec"] + int((time.monotonic() - self._begun) * 1e8)
        stamp["sec"], stamp["nanosec"] = divmod(ahead, 10**9)


@_mutant(
    "pose-without-retry-after",
    "pose-unavailable",
    "Before the first odometry, GET of the pose returns 503 without Retry-After.",
)
class _NotYet:
    def __init__(self) -> None:
        self._left = 40

    def __call__(self, request: Request, forward: Forward) -> Response:
        if _AT(request) and self._left:
            self._left -= 1
            return problem(503, "no odometry yet")(request)
        return forward(request)


_mutant("pose-clock-milliseconds", "pose-clock", "The stamp's nanosec counts milliseconds.").json(
    _AT, field(_NANOSEC, lambda nanosec: nanosec // 10**6)
)
_mutant("pose-numbers-as-text", "pose-type", "In one pose of 50, x is a string.").json(_AT, field(_X, str), nth=50)
_mutant("pose-quaternion-long", "pose-quaternion", "The orientation quaternion is 1 % too long.").json(
    _AT, field(_ORIENTATION, lambda q: {axis: 1.01 * part for axis, part in q.items()})
)
_mutant("pose-clockwise", "pose-rotation", "The heading has the wrong sign: it counts clockwise.").json(
    _AT, field(_ORIENTATION, turn(operator.neg))
)


_EMPTY = b'{"plan":{"header":{"stamp":{"sec":1,"nanosec":0},"frame_id":"map"},"poses":[]}}'
_GET, _POSES = rest("GET", PLAN), "plan.poses"


def _move(pose: Any, x: float, y: float) -> Any:
    at = pose["pose"]["position"]
    return {**pose, "pose": {**pose["pose"], "position": {**at, "x": at["x"] + x, "y": at["y"] + y}}}


def _detour(poses: list[Any]) -> list[Any]:
    middle = len(poses) // 2
    return [*poses[:middle], _move(poses[middle], 25.0, -25.0), *poses[middle:]]


def _aside(value: Any) -> None:
    path = value["plan"]
    if path["header"]["frame_id"] == "odom":
        path["poses"] = [_move(pose, 1.5, -1.0) for pose in path["poses"]]


def _no_start(given: dict[str, str]) -> None:
    for name in ("start_x", "start_y", "start_yaw"):
        given.pop(name, None)


def _quarter(given: dict[str, str]) -> None:
    given.setdefault("yaw", "1.5707963")


def _frame(value: Any) -> None:
    for pose in value["plan"]["poses"][1:]:
        pose["header"]["frame_id"] = "base_link"


_mutant("plan-heading-ignored", "plan-yaw", "The last pose of a plan has a heading that is 1 rad off.").json(
    _GET, field("plan.poses.-1.pose.orientation", turn(lambda yaw: yaw + 1.0))
)
_mutant("plan-without-stamps", "plan-type", "Poses of a plan have no header.").json(
    _GET, field(_POSES, lambda poses: [{"pose": one["pose"]} for one in poses])
)
_mutant("plan-from-elsewhere", "plan-start", "A plan begins 60 cm from the robot.").json(
    _GET, field(_POSES, lambda poses: [_move(poses[0], -0.36, 0.48), *poses])
)
_mutant("plan-falls-short", "plan-end", "A plan ends 50 cm before the requested pose.").json(
    _GET, field(_POSES, lambda poses: [*poses[:-1], _move(poses[-1], 0.3, 0.4)])
)
_mutant("plan-no-exponents", "plan-numbers", "The robot refuses a query with an exponent such as e+00.").instead(
    lambda request: _GET(request) and "e%2B" in request.query, problem(422, "x: no number")
)
