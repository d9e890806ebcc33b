"""Mutants that are dangerous: they drive on, drive too fast, or start by themselves."""

import time
from collections.abc import Callable
from typing import Any

from proof.mutation.changes import parsed, plain, problem, rest, success
from proof.mutation.messages import Forward, Request, Response, unchanged
from proof.mutation.table import Table
from proof.table1.mutants.crowd import later
from proof.table1.mutants.goal_memory import active
from proof.table1.mutants.input_effects import drive, goal_ahead, send_own
from proof.table1.mutants.paths import GOAL, LINEAR, VELOCITY
from proof.table1.mutants.velocity import speeds

MUTANTS = Table()
_mutant = MUTANTS.of_class("safety", "rest")

_PUT = rest("PUT", VELOCITY)
_PUTS = rest("PUT", VELOCITY, LINEAR)
_PUT_GOAL, _DELETE = rest("PUT", GOAL), rest("DELETE", GOAL)
_EVERY_S = 0.15  # pause after which a mutant that drives on repeats the velocity, s
_AXES = (("linear", "y"), ("linear", "z"), ("angular", "x"), ("angular", "y"))


def _moving(request: Request) -> bool:
    return any(speeds(request))


def _to_the_right(request: Request) -> bool:
    value: Any = parsed(request.body)
    return _moving(request) and value["linear"]["x"] > 0 > value["angular"]["z"]


def _again(request: Request, forward: Forward) -> None:
    send_own(request, forward, "PUT", VELOCITY, parsed(request.body))


def _stop(request: Request, forward: Forward) -> None:
    drive(request, forward, 0.0)


class _GoingOn:
    """A change that sends a request of its own after a velocity command, unless another command has come by then.

    ``act`` is called ``delay_s`` after the command, and then again for ``lasting_s``.
    """

    def __init__(self, act: Callable[[Request, Forward], object], delay_s: float, lasting_s: float = 0.0) -> None:
        self._act, self._delay_s, self._lasting_s = act, delay_s, lasting_s
        self._turn = 0

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if (_PUT(request) or _PUT_GOAL(request)) and success(response):
            self._turn += 1
            if _moving(request):
                self.begin(request, forward)
        return response

    def begin(self, request: Request, forward: Forward) -> None:
        """Act later, and again and again, until the next command."""
        later(self._delay_s, self._go_on, self._turn, request.copy(), forward)

    def _go_on(self, turn: int, request: Request, forward: Forward) -> None:
        until = time.monotonic() + self._lasting_s
        while self._turn == turn:
            self._act(request, forward)
            if time.monotonic() + _EVERY_S >= until:
                return
            time.sleep(_EVERY_S)


@_mutant("safety-no-renewal", "renewal", "Sending the same velocity again does not renew it.")
class _Once:
    def __init__(self) -> None:
        self._last: Any = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not _PUT(request):
            return forward(request)
        value = parsed(request.body)
        if value is not None and value == self._last and _moving(request):
            return plain(204)(request)
        response = forward(request)
        self._last = value if success(response) else self._last
        return response


@_mutant("safety-slow-cancel", "cancel", "After DELETE of the goal, the robot drives on for 3 s.")
class _SlowCancel:
    def __init__(self) -> None:
        self._until = 0.0

    def __call__(self, request: Request, forward: Forward) -> Response:
        gone = time.monotonic() < self._until
        if _DELETE(request) and not gone and active(forward, request) is not None:
            self._until = time.monotonic() + 3.0
            later(3.0, send_own, request.copy(), forward, "DELETE", GOAL)
            return plain(204)(request)
        if gone and rest("GET DELETE", GOAL)(request):
            return problem(404, "there is no goal")(request)
        return forward(request)


# Delay of a stop or cancel, and of its response, s.
_HELD_BACK_S = 4.0


@_mutant("safety-stop-held-back", "stop-answered", "PUT of zero velocity to a moving robot takes effect 4 s later.")
class _StopHeldBack:
    def __init__(self) -> None:
        self._moving = False

    def __call__(self, request: Request, forward: Forward) -> Response:
        if self._moving and _PUT(request) and _zero(parsed(request.body)):
            time.sleep(_HELD_BACK_S)
        response = forward(request)
        if _PUT(request) and success(response):
            self._moving = _moving(request)
        return response


@_mutant("safety-cancel-held-back", "stop-answered", "DELETE of the active goal takes effect 4 s later.")
def _cancel_held_back(request: Request, forward: Forward) -> Response:
    if _DELETE(request) and active(forward, request) is not None:
        time.sleep(_HELD_BACK_S)
    return forward(request)


@_mutant("safety-watchdog-sometimes", "watchdog", "Every second velocity that is not renewed goes on for 10 s.")
class _Sometimes(_GoingOn):
    def __init__(self) -> None:
        super().__init__(_again, 0.55, 10.0)
        self._ended = 0

    def _go_on(self, turn: int, request: Request, forward: Forward) -> None:
        if self._turn == turn:
            self._ended += 1
            if self._ended % 2:
                super()._go_on(turn, request, forward)


@_mutant("safety-second-wind", "cancel-stays", "One second after DELETE of the goal, the robot drives again.")
def _second_wind(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _DELETE(request) and response.status == 204:
        later(1.0, goal_ahead, request.copy(), forward, 0.8)
    return response


@_mutant("safety-cancel-creeps", "cancel-stays", "One second after DELETE of the goal, the robot creeps.")
def _creeps(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _DELETE(request) and response.status == 204:
        # Beyond the tolerances at rest of the good robots, 0.02 and 0.03 m/s, but less than twice these.
        later(1.0, drive, request.copy(), forward, 0.035)
    return response


def _clamp(value: Any) -> None:
    for vector, axis, limit in ((value.get("linear", value), "x", 0.25), (value.get("angular", {}), "z", 1.0)):
        if isinstance(vector.get(axis), int | float):
            vector[axis] = max(-limit, min(limit, vector[axis]))


def _two_wheeled(twist: Any) -> None:
    for part, axis in _AXES:
        if isinstance(twist[part][axis], int | float):
            twist[part][axis] = 0.0


def _too_fast(twist: Any) -> None:
    """Multiply measured velocities above 0.15 by four."""
    for part, axis in (("linear", "x"), ("angular", "z")):
        if abs(twist[part][axis]) > 0.15:
            twist[part][axis] *= 4


@_mutant("safety-no-stop", "stop", "PUT of a zero velocity returns a success, and the robot drives on for 3 s.")
class _Stubborn(_GoingOn):
    def __init__(self) -> None:
        super().__init__(_again, 0.0, 3.0)
        self._last: Request | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not _PUT(request):
            return forward(request)
        self._turn += 1
        if self._last is None or not _zero(parsed(request.body)):
            response = forward(request)
            if _moving(request) and success(response):
                self._last = request.copy()
            return response
        self.begin(self._last, forward)
        self._last = None
        return plain(204)(request)


def _zero(value: Any) -> bool:
    try:
        return not any(value[part][axis] for part in ("linear", "angular") for axis in "xyz")
    except (TypeError, KeyError):
        return False


def _carry_out(side: str, _octets: bytes, forward: Forward) -> None:
    """Carry out an incomplete request."""
    if side == "rest":
        drive(Request("rest", "PUT", VELOCITY), forward, 0.2)


class _GoingOnAfter(_GoingOn):
    """The same for some velocities only."""

    def __init__(self, when: Callable[[Request], bool]) -> None:
        super().__init__(lambda request, forward: forward(request.copy()), 0.15, 10.0)
        self._when = when

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if (_PUT(request) or _PUT_GOAL(request)) and success(response):
            self._turn += 1
            if self._when(request):
                self.begin(request, forward)
        return response


_mutant(
    "safety-relentless-after-xml", "watchdog", "The robot drives on for 10 s after a velocity that was sent as XML."
).made(lambda: _GoingOnAfter(lambda request: "xml" in request.media_type))
_mutant(
    "safety-relentless-when-slow", "watchdog", "The robot drives on for 10 s straight ahead or back at up to 0.1 m/s."
).made(lambda: _GoingOnAfter(lambda request: 0 < abs(speeds(request)[0]) <= 0.1 and not speeds(request)[1]))
_mutant(
    "safety-relentless-when-closed", "watchdog", "The robot drives on for 10 s after a velocity with Connection: close."
).made(
    lambda: _GoingOnAfter(lambda request: _moving(request) and (request.field("Connection") or "").lower() == "close")
)


@_mutant("safety-relentless-after-a-read", "hold-ends", "GET of the velocity with 406 renews a velocity command.")
class _RenewedByRead:
    def __init__(self) -> None:
        self._last: Request | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if _PUT(request) and success(response):
            self._last = request.copy() if _moving(request) else None
        elif _PUT_GOAL(request) and success(response):
            self._last = None
        elif rest("GET", VELOCITY)(request) and response.status == 406 and self._last is not None:
            forward(self._last.copy())
        return response


_mutant(
    "safety-torn-drives",
    "client-vanished",
    "An incomplete request moves the robot.",
    incomplete_request=lambda: _carry_out,
)(unchanged)
