"""Robots that do not know, or do not say, where they are."""

import copy
import math
import time
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import JSON, Make, altered, instead, parsed, plain, problem, rest, values
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import LINEAR, POSE, VELOCITY

_AT = rest("GET", POSE)


def _position(odometry: Any) -> Any:
    return odometry["pose"]["pose"]["position"]


def _orientation(odometry: Any) -> Any:
    return odometry["pose"]["pose"]["orientation"]


def _told(edit: Callable[[Any], Any], nth: int = 1) -> Make:
    """The odometry is altered on its way to the client."""
    return altered(_AT, values(edit), nth=nth)


def _scaled(factor: float) -> Callable[[Any], None]:
    def edit(odometry: Any) -> None:
        for axis in "xy":
            _position(odometry)[axis] *= factor

    return edit


def _turned(change: Callable[[float], float]) -> Callable[[Any], None]:
    def edit(odometry: Any) -> None:
        q = _orientation(odometry)
        yaw = change(2 * math.atan2(q["z"], q["w"]))
        q["z"], q["w"] = math.sin(yaw / 2), math.cos(yaw / 2)

    return edit


def _swapped(odometry: Any) -> None:
    at = _position(odometry)
    at["x"], at["y"] = at["y"], at["x"]


def _in_degrees(odometry: Any) -> None:
    odometry["twist"]["twist"]["angular"]["z"] = math.degrees(odometry["twist"]["twist"]["angular"]["z"])


class _Frozen:
    """Keeps parts of the first pose for ever."""

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


class _Lost:
    """From the sixtieth reading on there is no new odometry, and the last one is shown for ever."""

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


class _FastClock:
    """The robot's clock goes a tenth too fast."""

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


def _carried(odometry: Any) -> None:
    odometry["header"]["stamp"]["sec"] -= 1
    odometry["header"]["stamp"]["nanosec"] += 10**9


def _in_milliseconds(odometry: Any) -> None:
    odometry["header"]["stamp"]["nanosec"] //= 10**6


def _earlier(odometry: Any) -> None:
    odometry["header"]["stamp"]["sec"] -= 1


class _NotYet:
    """The first times there is no odometry: more often than anybody looks before the checks begin."""

    def __init__(self) -> None:
        self._left = 40

    def __call__(self, request: Request, forward: Forward) -> Response:
        if _AT(request) and self._left:
            self._left -= 1
            return problem(503, "no odometry yet")(request)
        return forward(request)


_mutant = of_class("rest-resources", "rest")

MUTANTS = (
    _mutant(
        "pose-short-covariance",
        "The pose's covariance has 35 values.",
        "pose-type",
        _told(lambda value: value["pose"].update(covariance=value["pose"]["covariance"][:35])),
    ),
    _mutant(
        "pose-without-child-frame",
        "The pose lacks child_frame_id.",
        "pose-type",
        _told(lambda value: value.pop("child_frame_id") and None),
    ),
    _mutant(
        "pose-numbers-as-text",
        "One pose in 50 has its x as a string.",
        "pose-type",
        _told(lambda value: _position(value).update(x=str(_position(value)["x"])), nth=50),
    ),
    _mutant(
        "pose-without-retry-after",
        "Before the first odometry, the pose is 503 without Retry-After.",
        "pose-unavailable",
        _NotYet,
    ),
    _mutant(
        "pose-quaternion-long",
        "The orientation's quaternion is 1 percent too long.",
        "pose-quaternion",
        _told(
            lambda value: _orientation(value).update({axis: 1.01 * part for axis, part in _orientation(value).items()})
        ),
    ),
    _mutant(
        "pose-quaternion-zero",
        "The orientation is four zeros.",
        "pose-quaternion",
        _told(lambda value: value["pose"]["pose"].update(orientation=dict.fromkeys("xyzw", 0.0))),
    ),
    _mutant(
        "pose-stamp-frozen", "The pose's header is for ever the first one's.", "pose-stamp", lambda: _Frozen("header")
    ),
    _mutant("pose-stamp-backwards", "Each fifth pose has a stamp a second back.", "pose-stamp", _told(_earlier, nth=5)),
    _mutant(
        "pose-stale",
        "The pose is for ever the first one, with a new stamp.",
        ("pose-motion", "pose-rotation"),
        lambda: _Frozen("pose", "twist"),
    ),
    _mutant(
        "pose-aside-sometimes",
        "One pose in 60 is a metre aside.",
        "pose-sample",
        _told(lambda value: _position(value).update(x=_position(value)["x"] + 1.0), nth=60),
    ),
    _mutant(
        "velocity-off-sometimes",
        "One measured velocity in 60 is 0.1 m/s more than that of the odometry.",
        "velocity-odometry",
        altered(
            rest("GET", VELOCITY), values(lambda twist: twist["linear"].update(x=twist["linear"]["x"] + 0.1)), nth=60
        ),
    ),
    _mutant("pose-in-centimetres", "The position is in centimetres.", "pose-motion", _told(_scaled(100))),
    _mutant("pose-mirrored", "The position's x and y are swapped.", "pose-motion", _told(_swapped)),
    _mutant("pose-clockwise", "The heading counts clockwise.", "pose-rotation", _told(_turned(lambda yaw: -yaw))),
    _mutant(
        "pose-half-turn", "The heading turns at half the rate.", "pose-rotation", _told(_turned(lambda yaw: yaw / 2))
    ),
    _mutant(
        "odometry-in-degrees",
        "The odometry's turning rate is in degrees per second.",
        "velocity-odometry",
        _told(_in_degrees),
    ),
    _mutant(
        "odometry-lost", "When the odometry ceases, pose and velocity are the last ones for ever.", "pose-fresh", _Lost
    ),
    _mutant(
        "pose-clock-milliseconds", "The stamp's nanoseconds are milliseconds.", "pose-clock", _told(_in_milliseconds)
    ),
    _mutant("pose-clock-fast", "The stamps' clock goes a tenth too fast.", "pose-clock", _FastClock),
    _mutant(
        "pose-nanosec-carried",
        "The stamp has a second less, and as many nanoseconds more.",
        "pose-type",
        _told(_carried),
    ),
    _mutant("pose-gone", "There is no pose: 404.", "pose-type", instead(_AT, problem(404, "there is no pose"))),
    _mutant("pose-no-content", "The pose is 204.", "pose-type", instead(_AT, plain(204))),
)
