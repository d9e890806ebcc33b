"""Robots that do not drive as they are told, or do not say how they drive."""

import json
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import (
    JSON,
    Make,
    altered,
    becomes,
    inputs,
    instead,
    page,
    parsed,
    plain,
    problem,
    rest,
    secretly,
    status,
    unwanted,
    values,
)
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import GOAL, LINEAR, VELOCITY

_GET, _PUT = rest("GET", VELOCITY), rest("PUT", VELOCITY)
_GET_LINEAR, _PUT_LINEAR = rest("GET", LINEAR), rest("PUT", LINEAR)
_LIMITS = (0.7, 2.5)
_STILL = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
_CRAWL = {**_STILL, "linear": {"x": 0.123, "y": 0.0, "z": 0.0}}


def _times(factor: float) -> Callable[[Any], None]:
    def edit(twist: Any) -> None:
        twist["linear"]["x"] *= factor
        twist["angular"]["z"] *= factor

    return edit


def _exchanged(twist: Any) -> None:
    twist["linear"]["x"], twist["angular"]["z"] = twist["angular"]["z"], twist["linear"]["x"]


def _integral(request: Request) -> bool:
    """Whether a velocity is written with an integer for the part that moves the robot."""
    value: Any = parsed(request.body) if _PUT(request) else None
    try:
        return isinstance(value["linear"]["x"], int) and isinstance(value["angular"]["z"], int)
    except (TypeError, KeyError):
        return False


class _Commanded:
    """GET shows what was commanded last, whatever the robot does."""

    def __init__(self) -> None:
        self._last: Any = _STILL

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if _PUT(request) and response.status in {200, 204}:
            self._last = parsed(request.body) or self._last
        if _GET(request):
            values(lambda twist: twist.update(self._last))(response)
        return response


class _WhileGoal:
    """During a goal, a velocity is answered with a status that nobody expects."""

    def __call__(self, request: Request, forward: Forward) -> Response:
        if _PUT(request):
            goal = forward(request.copy(method="GET", target=GOAL, body=b""))
            if goal.status == 200:
                return problem(423, "linear.x: a goal is active")(request)
        return forward(request)


def _whole(request: Request, forward: Forward) -> Response:
    """PUT of the linear part sets the whole velocity, with no turning."""
    if not _PUT_LINEAR(request):
        return forward(request)
    vector = parsed(request.body)
    if not isinstance(vector, dict):
        return forward(request)
    body = json.dumps({"linear": vector, "angular": _STILL["angular"]}).encode()
    response = forward(request.copy(target=VELOCITY, body=body))
    return plain(204)(request) if response.status == 200 else response


def _whole_back(request: Request, forward: Forward) -> Response:
    """PUT of a linear part that leads back sets the whole velocity."""
    vector = parsed(request.body) if _PUT_LINEAR(request) else None
    back = isinstance(vector, dict) and isinstance(vector.get("x"), int | float) and vector["x"] < 0
    return _whole(request, forward) if back else forward(request)


def _stuck(request: Request, forward: Forward) -> Response:
    """Valid linear velocities are accepted and forgotten."""
    if _PUT_LINEAR(request):
        vector = parsed(request.body)
        if isinstance(vector, dict) and vector.get("x"):
            return plain(204)(request)
    return forward(request)


def _other_half(request: Request, forward: Forward) -> Response:
    if not _GET_LINEAR(request):
        return forward(request)
    response = forward(request.copy(target=VELOCITY))
    values(lambda twist: twist["angular"])(response)
    return response


def _good(twist: Any) -> bool:
    """Whether a Twist is one that a robot would take; others stay as they are, to be refused."""
    try:
        numbers = [twist[part][axis] for part in ("linear", "angular") for axis in "xyz"]
        slow = abs(twist["linear"]["x"]) < 0.5 and abs(twist["angular"]["z"]) < 1.6
        return all(isinstance(one, int | float) for one in numbers) and slow
    except (TypeError, KeyError):
        return False


def _told(edit: Callable[[Any], Any], nth: int = 1) -> Make:
    """The measured velocity is altered on its way to the client."""
    return altered(_GET, values(edit), nth=nth)


def _driven(edit: Callable[[Any], Any]) -> Make:
    """A good velocity is altered on its way to the robot."""
    return secretly(_PUT, inputs(lambda twist: edit(twist) if _good(twist) else None))


def _beyond(share: float) -> Callable[[Request], bool]:
    """PUTs of a velocity beyond a share of the limits, which is within them."""

    def where(request: Request) -> bool:
        twist: Any = parsed(request.body) if _PUT(request) else None
        try:
            used = max(abs(twist["linear"]["x"]) / _LIMITS[0], abs(twist["angular"]["z"]) / _LIMITS[1])
        except (TypeError, KeyError):
            return False
        return bool(share < used <= 1)

    return where


def _short_of(share: float) -> Callable[[Any], None]:
    """The robot does not quite get to its limits."""

    def edit(twist: Any) -> None:
        for part, axis, limit in (("linear", "x", _LIMITS[0]), ("angular", "z", _LIMITS[1])):
            twist[part][axis] = max(-share * limit, min(share * limit, twist[part][axis]))

    return edit


def _forwards_only(twist: Any) -> None:
    twist["linear"]["x"] = max(0.0, twist["linear"]["x"])


def _mirrored(twist: Any) -> None:
    twist["angular"]["z"] = -twist["angular"]["z"]


_mutant = of_class("rest-resources", "rest")

MUTANTS = (
    _mutant(
        "velocity-without-angular",
        "GET of the velocity has no angular part.",
        "velocity-type",
        _told(lambda twist: twist.pop("angular") and None),
    ),
    _mutant(
        "velocity-null",
        "One velocity in 50 has null for linear.y.",
        "velocity-type",
        _told(lambda twist: twist["linear"].update(y=None), nth=50),
    ),
    _mutant(
        "velocity-in-kilometres-per-hour",
        "The measured velocity is in km/h.",
        ("velocity-odometry", "velocity-converges"),
        _told(_times(3.6)),
    ),
    _mutant(
        "velocity-stands-still",
        "The measured velocity is always zero.",
        ("velocity-odometry", "velocity-converges"),
        _told(lambda twist: twist.update(_STILL)),
    ),
    _mutant(
        "velocity-swapped",
        "Linear and angular velocity are exchanged in what is read.",
        "velocity-converges",
        _told(_exchanged),
    ),
    _mutant(
        "velocity-as-commanded",
        "GET shows the velocity that was commanded, although the robot has long stopped.",
        ("velocity-odometry", "safety/watchdog"),
        _Commanded,
    ),
    _mutant("velocity-put-created", "PUT of a velocity is 201.", "velocity-put", altered(_PUT, becomes(201))),
    _mutant(
        "velocity-put-other",
        "PUT of a velocity answers 200 with a Twist that was not asked for.",
        "velocity-put",
        altered(_PUT, page(200, json.dumps(_CRAWL).encode(), JSON)),
    ),
    _mutant(
        "velocity-lost",
        "Velocities are accepted and forgotten.",
        "velocity-converges",
        _driven(lambda twist: twist.update(_STILL)),
    ),
    _mutant(
        "velocity-unwanted-lost",
        "A velocity is answered 204 and forgotten where the client accepts no format of the answer.",
        "velocity-converges",
        instead(unwanted(_PUT), plain(204)),
    ),
    _mutant(
        "velocity-halved", "The robot drives at half of what it is told.", "velocity-converges", _driven(_times(0.5))
    ),
    _mutant(
        "velocity-refused-near-limits",
        "Above nine tenths of its limits the robot refuses a velocity.",
        "velocity-range",
        instead(_beyond(0.9), problem(422, "linear.x, angular.z: too fast")),
    ),
    _mutant(
        "velocity-short-of-limits",
        "The robot gets to nine tenths of its limits, and no farther.",
        "velocity-range",
        secretly(_beyond(0.9), inputs(_short_of(0.9))),
    ),
    _mutant(
        "velocity-forwards-only",
        "The robot takes velocities backwards, and stands still.",
        "velocity-range",
        secretly(_beyond(0.0), inputs(_forwards_only)),
    ),
    _mutant("velocity-reversed", "The robot turns the other way.", "velocity-converges", _driven(_mirrored)),
    _mutant(
        "velocity-integers-refused",
        "A velocity written in integers is refused.",
        "velocity-integers",
        instead(_integral, problem(422, "linear.x: an integer is no float")),
    ),
    _mutant(
        "velocity-locked-by-goal", "While a goal is active, a velocity is answered 423.", "velocity-goal", _WhileGoal
    ),
    _mutant(
        "linear-without-z",
        "GET of the linear velocity has no z.",
        "linear-type",
        altered(_GET_LINEAR, values(lambda vector: {axis: vector[axis] for axis in "xy"})),
    ),
    _mutant(
        "linear-is-angular",
        "GET of the linear velocity gives the whole Twist's other half.",
        "linear-agrees",
        lambda: _other_half,
    ),
    _mutant("linear-lost", "PUT of a linear velocity is accepted and forgotten.", "linear-put", lambda: _stuck),
    _mutant(
        "linear-unwanted-lost",
        "A linear velocity is answered 204 and forgotten where the client accepts no format of the answer.",
        "linear-put",
        instead(unwanted(_PUT_LINEAR), plain(204)),
    ),
    _mutant(
        "linear-put-created",
        "PUT of a linear velocity is 201.",
        "linear-put",
        altered(_PUT_LINEAR, becomes(201), status(200, 204)),
    ),
    _mutant(
        "linear-stops-turning", "PUT of a linear velocity ends the turning.", "linear-keeps-angular", lambda: _whole
    ),
    _mutant(
        "linear-back-stops-turning",
        "PUT of a linear velocity that leads back ends the turning.",
        "linear-keeps-angular",
        lambda: _whole_back,
    ),
)
