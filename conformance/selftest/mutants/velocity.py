"""Robots that do not drive as they are told, or do not say how they drive."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from conformance.selftest.mutants.changes import (
    GOAL,
    LINEAR,
    VELOCITY,
    altered,
    becomes,
    inputs,
    instead,
    parsed,
    plain,
    problem,
    remembering,
    rest,
    secretly,
    status,
    values,
)
from conformance.selftest.mutants.mutant import Fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

_GET, _PUT = rest("GET", VELOCITY), rest("PUT", VELOCITY)
_GET_LINEAR, _PUT_LINEAR = rest("GET", LINEAR), rest("PUT", LINEAR)
_STILL = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}


def _times(factor: float) -> Callable[[Any], None]:
    def edit(twist: Any) -> None:
        twist["linear"]["x"] *= factor
        twist["angular"]["z"] *= factor

    return edit


def _exchanged(twist: Any) -> None:
    twist["linear"]["x"], twist["angular"]["z"] = twist["angular"]["z"], twist["linear"]["x"]


def _integral(ask: Ask) -> bool:
    """Whether a velocity is written with an integer for the part that moves the robot."""
    value: Any = parsed(ask.body) if _PUT(ask) else None
    try:
        return isinstance(value["linear"]["x"], int) and isinstance(value["angular"]["z"], int)
    except (TypeError, KeyError):
        return False


class _Commanded:
    """GET shows what was commanded last, whatever the robot does."""

    def __init__(self) -> None:
        self._last: Any = _STILL

    def __call__(self, ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
        answer = forward(ask)
        if _PUT(ask) and answer.status in {200, 204}:
            self._last = parsed(ask.body) or self._last
        if _GET(ask):
            values(lambda twist: twist.update(self._last))(answer)
        return answer


class _WhileGoal:
    """During a goal, a velocity is answered with a status that nobody expects."""

    def __call__(self, ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
        if _PUT(ask):
            goal = forward(ask.copy(method="GET", target=GOAL, body=b""))
            if goal.status == 200:
                return problem(423, "linear.x: a goal is active")(ask)
        return forward(ask)


def _whole(ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
    """PUT of the linear part sets the whole velocity, with no turning."""
    if not _PUT_LINEAR(ask):
        return forward(ask)
    vector = parsed(ask.body)
    if not isinstance(vector, dict):
        return forward(ask)
    body = json.dumps({"linear": vector, "angular": _STILL["angular"]}).encode()
    answer = forward(ask.copy(target=VELOCITY, body=body))
    return plain(204)(ask) if answer.status == 200 else answer


def _stuck(ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
    """Valid linear velocities are accepted and forgotten."""
    if _PUT_LINEAR(ask):
        vector = parsed(ask.body)
        if isinstance(vector, dict) and vector.get("x"):
            return plain(204)(ask)
    return forward(ask)


def _other_half(ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
    if not _GET_LINEAR(ask):
        return forward(ask)
    answer = forward(ask.copy(target=VELOCITY))
    values(lambda twist: twist["angular"])(answer)
    return answer


def _replaced(answer: Answer, value: Any) -> None:
    answer.status, answer.reason, answer.body = 200, "", json.dumps(value).encode()
    answer.put("Content-Type", "application/json")


def _good(twist: Any) -> bool:
    """Whether a Twist is one that a robot would take; others stay as they are, to be refused."""
    try:
        numbers = [twist[part][axis] for part in ("linear", "angular") for axis in "xyz"]
        slow = abs(twist["linear"]["x"]) < 0.5 and abs(twist["angular"]["z"]) < 1.6
        return all(isinstance(one, int | float) for one in numbers) and slow
    except (TypeError, KeyError):
        return False


def _mirrored(twist: Any) -> None:
    twist["angular"]["z"] = -twist["angular"]["z"]


FAULTS = (
    Fault(
        "velocity-without-angular",
        "GET of the velocity has no angular part.",
        ("rest-resources/velocity-type",),
        "rest",
        altered(_GET, values(lambda twist: twist.pop("angular") and None)),
    ),
    Fault(
        "velocity-null",
        "One velocity in 50 has null for linear.y.",
        ("rest-resources/velocity-type",),
        "rest",
        altered(_GET, values(lambda twist: twist["linear"].update(y=None)), nth=50),
    ),
    Fault(
        "velocity-in-kilometres-per-hour",
        "The measured velocity is in km/h.",
        ("rest-resources/velocity-odometry", "rest-resources/velocity-converges"),
        "rest",
        altered(_GET, values(_times(3.6))),
    ),
    Fault(
        "velocity-stands-still",
        "The measured velocity is always zero.",
        ("rest-resources/velocity-odometry", "rest-resources/velocity-converges"),
        "rest",
        altered(_GET, values(lambda twist: twist.update(_STILL))),
    ),
    Fault(
        "velocity-swapped",
        "Linear and angular velocity are exchanged in what is read.",
        ("rest-resources/velocity-converges",),
        "rest",
        altered(_GET, values(_exchanged)),
    ),
    Fault(
        "velocity-as-commanded",
        "GET shows the velocity that was commanded, although the robot has long stopped.",
        ("rest-resources/velocity-odometry", "safety/watchdog"),
        "rest",
        remembering(_Commanded),
    ),
    Fault(
        "velocity-put-created",
        "PUT of a velocity is 201.",
        ("rest-resources/velocity-put",),
        "rest",
        altered(_PUT, becomes(201)),
    ),
    Fault(
        "velocity-put-other",
        "PUT of a velocity answers 200 with a Twist that was not asked for.",
        ("rest-resources/velocity-put",),
        "rest",
        altered(_PUT, lambda answer: _replaced(answer, {**_STILL, "linear": {"x": 0.123, "y": 0.0, "z": 0.0}})),
    ),
    Fault(
        "velocity-lost",
        "Velocities are accepted and forgotten.",
        ("rest-resources/velocity-converges",),
        "rest",
        secretly(_PUT, inputs(lambda twist: twist.update(_STILL) if _good(twist) else None)),
    ),
    Fault(
        "velocity-halved",
        "The robot drives at half of what it is told.",
        ("rest-resources/velocity-converges",),
        "rest",
        secretly(_PUT, inputs(lambda twist: _times(0.5)(twist) if _good(twist) else None)),
    ),
    Fault(
        "velocity-reversed",
        "The robot turns the other way.",
        ("rest-resources/velocity-converges",),
        "rest",
        secretly(_PUT, inputs(lambda twist: _mirrored(twist) if _good(twist) else None)),
    ),
    Fault(
        "velocity-integers-refused",
        "A velocity written in integers is refused.",
        ("rest-resources/velocity-integers",),
        "rest",
        instead(_integral, problem(422, "linear.x: an integer is no float")),
    ),
    Fault(
        "velocity-locked-by-goal",
        "While a goal is active, a velocity is answered 423.",
        ("rest-resources/velocity-goal",),
        "rest",
        remembering(_WhileGoal),
    ),
    Fault(
        "linear-without-z",
        "GET of the linear velocity has no z.",
        ("rest-resources/linear-type",),
        "rest",
        altered(_GET_LINEAR, values(lambda vector: {axis: vector[axis] for axis in "xy"})),
    ),
    Fault(
        "linear-is-angular",
        "GET of the linear velocity gives the whole Twist's other half.",
        ("rest-resources/linear-agrees",),
        "rest",
        lambda: _other_half,
    ),
    Fault(
        "linear-lost",
        "PUT of a linear velocity is accepted and forgotten.",
        ("rest-resources/linear-put",),
        "rest",
        lambda: _stuck,
    ),
    Fault(
        "linear-put-created",
        "PUT of a linear velocity is 201.",
        ("rest-resources/linear-put",),
        "rest",
        altered(_PUT_LINEAR, becomes(201), status(200, 204)),
    ),
    Fault(
        "linear-stops-turning",
        "PUT of a linear velocity ends the turning.",
        ("rest-resources/linear-keeps-angular",),
        "rest",
        lambda: _whole,
    ),
)
