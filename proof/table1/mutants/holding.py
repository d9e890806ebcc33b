"""Mutants whose velocity commands end or restart for a wrong reason."""

import threading
import time
from typing import Any

from proof.mutation.changes import parsed, plain, rest, success
from proof.mutation.fields import value_at
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.crowd import later
from proof.table1.mutants.input_effects import send_own
from proof.table1.mutants.paths import GOAL, LINEAR, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("safety", "rest")

_PUT, _PUT_LINEAR, _PUTS = rest("PUT", VELOCITY), rest("PUT", LINEAR), rest("PUT", VELOCITY, LINEAR)
_DELETE, _PUT_GOAL, _POST = rest("DELETE", GOAL), rest("PUT", GOAL), rest("POST", VELOCITY)
_SILENT_S = 0.12  # silence after which no client counts as reading, s
_LOOK_S = 0.04  # pause between looks, s


class Remembering:
    """A change that remembers the last accepted velocity, the number of commands, and the last request's time."""

    def __init__(self) -> None:
        self.last: Any = None
        self.turn = 0
        self.asked = 0.0
        self.lock = threading.Lock()

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Forward a request, and remember it."""
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
class _Asleep(Remembering):
    def put(self, request: Request, response: Response, forward: Forward) -> None:
        super().put(request, response, forward)
        if success(response) and self.last and "angular" in self.last:
            later(_LOOK_S, self._watch, self.turn, request.copy(), forward)

    def _watch(self, turn: int, request: Request, forward: Forward) -> None:
        until = time.monotonic() + 5
        while time.monotonic() < until and self.turn == turn:
            if time.monotonic() - self.asked > _SILENT_S:
                send_own(request, forward, "PUT", VELOCITY, self.last)
            time.sleep(_LOOK_S)


@_mutant("safety-renewed-by-refusal", "hold-ends", "A refused velocity command renews the previous one.")
class _Renewed(Remembering):
    def put(self, request: Request, response: Response, forward: Forward) -> None:
        super().put(request, response, forward)
        driving = (
            self.last and "angular" in self.last and any(value_at(self.last, one) for one in ("linear.x", "angular.z"))
        )
        if 400 <= response.status < 500 and driving:
            send_own(request, forward, "PUT", VELOCITY, self.last)


@_mutant("safety-renewed-by-soap", "hold-ends", "A SOAP message that only reads renews the velocity.")
class _RenewedBySoap(Remembering):
    def __call__(self, request: Request, forward: Forward) -> Response:
        response = super().__call__(request, forward)
        if request.side == "soap" and self.last and "angular" in self.last:
            send_own(request, forward, "PUT", VELOCITY, self.last)
        return response


@_mutant("safety-linear-deaf", "renewal", "A PUT of a linear velocity that is there already does not renew it.")
class _LinearDeaf(Remembering):
    def __call__(self, request: Request, forward: Forward) -> Response:
        value: Any = parsed(request.body) if _PUT_LINEAR(request) else None
        if isinstance(value, dict) and self.last and self.last.get("linear") == value:
            return plain(204)(request)
        return super().__call__(request, forward)

    def put(self, request: Request, response: Response, _forward: Forward) -> None:
        if not _PUT_LINEAR(request):
            self.last = None
        elif success(response):
            self.last = {"linear": parsed(request.body)}


@_mutant("safety-post-and-driven", "refused-keeps", "POST of a velocity returns 405, and the robot drives.")
def _post_drives(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _POST(request) and response.status == 405 and request.body:
        forward(request.copy(method="PUT"))
    return response


@_mutant("safety-without-slash-and-driven", "refused-keeps", "A velocity to the path without its slash is taken.")
def _slashless_drives(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if request.method == "PUT" and request.path == VELOCITY.rstrip("/") and response.status == 404:
        forward(request.copy(target=VELOCITY))
    return response


@_mutant("safety-goal-refused-stops", "refused-keeps", "A goal that is refused stops a robot that is being driven.")
def _goal_stops(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _PUT_GOAL(request) and 400 <= response.status < 500:
        still = {"x": 0.0, "y": 0.0, "z": 0.0}
        send_own(request, forward, "PUT", VELOCITY, {"linear": still, "angular": still})
    return response


@_mutant(
    "linear-revives-turning",
    "rest-resources/linear-keeps-angular",
    "PUT of a linear velocity restarts a turning that had ended.",
)
class _Revived(Remembering):
    def put(self, request: Request, response: Response, forward: Forward) -> None:
        super().put(request, response, forward)
        if _PUT_LINEAR(request) and success(response) and self.last and "angular" in self.last:
            send_own(request, forward, "PUT", VELOCITY, self.last)


@_mutant(
    "safety-resuming", "cancel-stays", "After DELETE of the goal, the robot drives the velocity from before the goal."
)
class _Resuming(Remembering):
    def __call__(self, request: Request, forward: Forward) -> Response:
        response = super().__call__(request, forward)
        if _DELETE(request) and response.status == 204 and self.last and "angular" in self.last:
            # After the navigation's own last command, which is zero.
            later(0.2, send_own, request.copy(), forward, "PUT", VELOCITY, self.last)
        return response


@_mutant("safety-deaf", "hold", "While a velocity command holds, sending it again does not renew it.")
class _Deaf(Remembering):
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


@_mutant(
    "goal-deleted-later",
    "rest-resources/goal-delete",
    "DELETE returns 204, and the goal is cancelled only 0.3 s later.",
)
def _deleted_later(request: Request, forward: Forward) -> Response:
    if not _DELETE(request) or forward(request.copy(method="GET")).status != 200:
        return forward(request)
    later(0.3, send_own, request.copy(), forward, "DELETE", GOAL)
    return plain(204)(request)
