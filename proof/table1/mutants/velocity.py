"""Mutants that drive at another velocity than commanded, or return a wrong velocity."""

import json
import time
from collections.abc import Callable
from typing import Any

from proof.mutation.changes import Make, inputs, parsed, plain, rest, secretly, values
from proof.mutation.fields import each, field, scaled
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import GOAL, LINEAR, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-resources", "rest")

_GET, _PUT = rest("GET", VELOCITY), rest("PUT", VELOCITY)
_GET_LINEAR, _PUT_LINEAR = rest("GET", LINEAR), rest("PUT", LINEAR)
_LIMITS = (0.7, 2.5)
_SMALL = 0.05
_STILL = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}


def times(factor: float) -> Callable[[Any], None]:
    """Return an edit that multiplies the two components of a Twist that the robot can drive."""
    return each(field("linear.x", scaled(factor)), field("angular.z", scaled(factor)))


def _integral(request: Request) -> bool:
    """Return whether a PUT writes linear.x and angular.z as integers."""
    value: Any = parsed(request.body) if _PUT(request) else None
    try:
        return isinstance(value["linear"]["x"], int) and isinstance(value["angular"]["z"], int)
    except (TypeError, KeyError):
        return False


@_mutant(
    "velocity-as-commanded",
    ("velocity-odometry", "safety/watchdog"),
    "GET returns the last commanded velocity, even after the robot has stopped.",
)
class _Commanded:
    def __init__(self) -> None:
        self._last: Any = _STILL

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if _PUT(request) and response.status in {200, 204}:
            self._last = parsed(request.body) or self._last
        if _GET(request):
            values(lambda twist: twist.update(self._last))(response)
        return response


def speeds(request: Request) -> tuple[float, float]:
    """Return how fast, m/s and rad/s, a request commands the robot to drive and turn; zeros where it commands none."""
    twist: Any = parsed(request.body) if _PUT(request) else None
    try:
        return abs(twist["linear"]["x"]), abs(twist["angular"]["z"])
    except (TypeError, KeyError):
        return 0.0, 0.0


def _while_goal(response: Callable[[Request], Response], where: Callable[[Request], bool] = _PUT) -> Make:
    """Return a change that answers velocity commands itself while a goal is active."""

    def change(request: Request, forward: Forward) -> Response:
        active = where(request) and forward(request.copy(method="GET", target=GOAL, body=b"")).status == 200
        return response(request) if active else forward(request)

    return lambda: change


@_mutant("linear-stops-turning", "linear-keeps-angular", "PUT of a linear velocity stops the turning.")
def _whole(request: Request, forward: Forward) -> Response:
    if not _PUT_LINEAR(request):
        return forward(request)
    vector = parsed(request.body)
    if not isinstance(vector, dict):
        return forward(request)
    body = json.dumps({"linear": vector, "angular": _STILL["angular"]}).encode()
    response = forward(request.copy(target=VELOCITY, body=body))
    return plain(204)(request) if response.status == 200 else response


@_mutant("linear-back-stops-turning", "linear-keeps-angular", "PUT of a backward linear velocity stops the turning.")
def _whole_back(request: Request, forward: Forward) -> Response:
    vector = parsed(request.body) if _PUT_LINEAR(request) else None
    back = isinstance(vector, dict) and isinstance(vector.get("x"), int | float) and vector["x"] < 0
    return _whole(request, forward) if back else forward(request)


def _forwards_or_back(request: Request) -> bool:
    vector = parsed(request.body) if _PUT_LINEAR(request) else None
    return isinstance(vector, dict) and bool(vector.get("x"))


@_mutant("linear-is-angular", "linear-agrees", "GET of the linear velocity returns the angular part.")
def _other_half(request: Request, forward: Forward) -> Response:
    if not _GET_LINEAR(request):
        return forward(request)
    response = forward(request.copy(target=VELOCITY))
    values(lambda twist: twist["angular"])(response)
    return response


def _good(twist: Any) -> bool:
    """Return whether a Twist is valid and slow; the robot is to refuse others itself."""
    try:
        numbers = [twist[part][axis] for part in ("linear", "angular") for axis in "xyz"]
        slow = abs(twist["linear"]["x"]) < 0.5 and abs(twist["angular"]["z"]) < 1.6
        return all(isinstance(number, int | float) for number in numbers) and slow
    except (TypeError, KeyError):
        return False


def _edit_commands(edit: Callable[[Any], Any]) -> Make:
    """Return a change that applies ``edit`` to valid velocity commands and answers 204."""
    return secretly(_PUT, inputs(lambda twist: edit(twist) if _good(twist) else None))


def _beyond(share: float) -> Callable[[Request], bool]:
    """Return a condition for velocity commands between ``share`` of the limits and the limits."""
    return lambda request: share < max(_shares(request)) <= 1


def _shares(request: Request) -> list[float]:
    return [speed / limit for speed, limit in zip(speeds(request), _LIMITS, strict=True)]


def _slow(request: Request) -> bool:
    return any(0.0 < speed < _SMALL for speed in speeds(request))


def _still_if_slow(component: float) -> float:
    return 0.0 if abs(component) < _SMALL else component


def _short_of(share: float) -> Callable[[Any], None]:
    """Return an edit that clamps a Twist to ``share`` of the limits."""

    def edit(twist: Any) -> None:
        for part, axis, limit in (("linear", "x", _LIMITS[0]), ("angular", "z", _LIMITS[1])):
            twist[part][axis] = max(-share * limit, min(share * limit, twist[part][axis]))

    return edit


_mutant(
    "velocity-one-at-once", "velocity-both", "Near both limits at once, the robot drives at half the linear velocity."
).made(secretly(lambda request: min(_shares(request)) >= 0.7, inputs(field("linear.x", scaled(0.5)))))
_mutant(
    "velocity-stands-still", ("velocity-odometry", "velocity-converges"), "The measured velocity is always zero."
).json(_GET, lambda twist: twist.update(_STILL))
_mutant("velocity-lost", "velocity-converges", "PUT of a velocity returns a success without any effect.").made(
    _edit_commands(lambda twist: twist.update(_STILL))
)
_mutant("velocity-forwards-only", "velocity-range", "The robot accepts backward velocities and stands still.").made(
    secretly(_beyond(0.0), inputs(field("linear.x", lambda x: max(0.0, x))))
)


@_mutant("linear-as-commanded", "linear-agrees", "GET of the linear velocity returns the commanded one for a second.")
class _LinearCommanded:
    def __init__(self) -> None:
        self._last: Any = None
        self._until = 0.0

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        value: Any = parsed(request.body)
        if (_PUT(request) or _PUT_LINEAR(request)) and response.status in {200, 204} and isinstance(value, dict):
            self._last, self._until = value.get("linear", value), time.monotonic() + 1.0
        if _GET_LINEAR(request) and response.status == 200 and time.monotonic() < self._until:
            shown: Any = parsed(response.body)
            if isinstance(shown, dict):
                response.body = json.dumps(self._last).encode()
        return response
