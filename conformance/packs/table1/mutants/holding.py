"""Mutants whose velocity commands end or restart for a wrong reason."""

import json
import threading
import time
from typing import Any

from conformance.mutation.changes import parsed, plain, rest, success
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.packs.table1.mutants.in_background import later
from conformance.packs.table1.mutants.input_effects import sent
from conformance.packs.table1.mutants.paths import GOAL, LINEAR, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("safety", "rest")

_PUT, _PUT_LINEAR, _PUTS = rest("PUT", VELOCITY), rest("PUT", LINEAR), rest("PUT", VELOCITY, LINEAR)
_DELETE, _PUT_GOAL = rest("DELETE", GOAL), rest("PUT", GOAL)
# Nobody asks: nothing has come for so long; and how often is looked, s.
_SILENT_S, _LOOK_S = 0.12, 0.04
_LIMITS = (0.7, 2.5)
_SMALL = 0.05


class _Remembering:
    """A change that remembers the last accepted velocity, counts commands, and knows when the last request came."""

    def __init__(self) -> None:
        self.last: Any = None
        self.turn = 0
        self.asked = 0.0
        self.lock = threading.Lock()

    def __call__(self, request: Request, forward: Forward) -> Response:
        self.asked = time.monotonic()
        response = forward(request)
        if _PUT_GOAL(request) and success(response):
            self.turn += 1
        if _PUTS(request):
            self.put(request, response, forward)
        self.asked = time.monotonic()
        return response

    def put(self, request: Request, response: Response, _forward: Forward) -> None:
        """Remember the velocity of a successful PUT."""
        value = parsed(request.body)
        if not success(response) or not isinstance(value, dict):
            return
        with self.lock:
            self.turn += 1
            self.last = {**(self.last or {}), "linear": value} if _PUT_LINEAR(request) and self.last else value


@_mutant("safety-asleep", "hold-ends", "A velocity command ends only while clients send requests.")
class _Asleep(_Remembering):
    def put(self, request: Request, response: Response, forward: Forward) -> None:
        super().put(request, response, forward)
        if success(response) and self.last and "angular" in self.last:
            later(_LOOK_S, self._watch, self.turn, request.copy(), forward)

    def _watch(self, turn: int, request: Request, forward: Forward) -> None:
        until = time.monotonic() + 5
        while time.monotonic() < until and self.turn == turn:
            if time.monotonic() - self.asked > _SILENT_S:
                sent(request, forward, "PUT", VELOCITY, self.last)
            time.sleep(_LOOK_S)


@_mutant("safety-renewed-by-refusal", "hold-ends", "A refused velocity command renews the previous one.")
class _Renewed(_Remembering):
    def put(self, request: Request, response: Response, forward: Forward) -> None:
        super().put(request, response, forward)
        if 400 <= response.status < 500 and self.last and "angular" in self.last and any(_parts(self.last)):
            sent(request, forward, "PUT", VELOCITY, self.last)


@_mutant(
    "linear-revives-turning",
    "rest-resources/linear-keeps-angular",
    "PUT of a linear velocity restarts a turning that had ended.",
)
class _Revived(_Remembering):
    def put(self, request: Request, response: Response, forward: Forward) -> None:
        super().put(request, response, forward)
        if _PUT_LINEAR(request) and success(response) and self.last and "angular" in self.last:
            sent(request, forward, "PUT", VELOCITY, self.last)


@_mutant(
    "safety-resuming", "cancel-stays", "After DELETE of the goal, the robot drives the velocity from before the goal."
)
class _Resuming(_Remembering):
    def __call__(self, request: Request, forward: Forward) -> Response:
        response = super().__call__(request, forward)
        if _DELETE(request) and response.status == 204 and self.last and "angular" in self.last:
            # Not before the navigation's own last word, which is zero.
            later(0.2, sent, request.copy(), forward, "PUT", VELOCITY, self.last)
        return response


@_mutant("safety-deaf", "hold", "While a velocity command holds, sending it again does not renew it.")
class _Deaf(_Remembering):
    _HOLD_S = 1.0

    def __init__(self) -> None:
        super().__init__()
        self._taken = 0.0

    def __call__(self, request: Request, forward: Forward) -> Response:
        value: Any = parsed(request.body) if _PUTS(request) else None
        if isinstance(value, dict) and self.last and time.monotonic() < self._taken + self._HOLD_S:
            value = {**self.last, "linear": value} if _PUT_LINEAR(request) else value
            if value == self.last:
                return plain(204)(request)
        return super().__call__(request, forward)

    def put(self, request: Request, response: Response, forward: Forward) -> None:
        super().put(request, response, forward)
        if success(response):
            self._taken = time.monotonic()


def _parts(twist: Any) -> tuple[float, float]:
    try:
        return abs(twist["linear"]["x"]), abs(twist["angular"]["z"])
    except (TypeError, KeyError):
        return 0.0, 0.0


@_mutant(
    "velocity-one-at-once",
    "rest-resources/velocity-range",
    "Near both limits at once, the robot drives at half the linear velocity.",
)
def _one_at_once(request: Request, forward: Forward) -> Response:
    value: Any = parsed(request.body) if _PUT(request) else None
    if any(part < 0.7 * limit for part, limit in zip(_parts(value), _LIMITS, strict=True)):
        return forward(request)
    value["linear"]["x"] /= 2
    response = forward(request.copy(body=json.dumps(value).encode()))
    return plain(204)(request) if success(response) else response


@_mutant(
    "velocity-deadband",
    "rest-resources/velocity-range",
    "The robot accepts velocities below 0.05 m/s or rad/s and stands still.",
)
def _deadband(request: Request, forward: Forward) -> Response:
    value: Any = parsed(request.body) if _PUT(request) else None
    if not any(0.0 < part < _SMALL for part in _parts(value)):
        return forward(request)
    for side, axis in (("linear", "x"), ("angular", "z")):
        if abs(value[side][axis]) < _SMALL:
            value[side][axis] = 0.0
    response = forward(request.copy(body=json.dumps(value).encode()))
    return plain(204)(request) if success(response) else response


@_mutant(
    "velocity-forgotten-for-goal",
    "rest-resources/velocity-goal",
    "While a goal is active, PUT of a velocity returns 204 without any effect.",
)
def _forgotten(request: Request, forward: Forward) -> Response:
    if _PUT(request) and forward(request.copy(method="GET", target=GOAL, body=b"")).status == 200:
        return plain(204)(request)
    return forward(request)


@_mutant(
    "goal-deleted-later",
    "rest-resources/goal-delete",
    "DELETE returns 204, and the goal is cancelled only 0.3 s later.",
)
def _deleted_later(request: Request, forward: Forward) -> Response:
    if not _DELETE(request) or forward(request.copy(method="GET")).status != 200:
        return forward(request)
    later(0.3, sent, request.copy(), forward, "DELETE", GOAL)
    return plain(204)(request)
