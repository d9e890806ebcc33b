"""Mutants that refuse a request rightly, but break something in another state later."""

import contextlib
import json
from collections.abc import Callable
from typing import Any

from proof.mutation.changes import parsed, plain, refusal, rest, soap, success
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.goal_memory import active, identity, pose_of
from proof.table1.mutants.holding import Remembering
from proof.table1.mutants.input_effects import send_own
from proof.table1.mutants.paths import DELIVERIES, GOAL, LINEAR, PLAN, POSE, SENSORS, VELOCITY, deliveries

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-resources", "rest")

_PUT_GOAL, _DELETE, _GET = rest("PUT", GOAL), rest("DELETE", GOAL), rest("GET", GOAL)
_PUTS = rest("PUT", VELOCITY, LINEAR)
_REFUSED = frozenset(range(400, 500))
_ORDERS = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _is_xml(request: Request) -> bool:
    return _PUT_GOAL(request) and "xml" in (request.field("Content-Type") or "")


def _no_frame(request: Request) -> bool:
    return _PUT_GOAL(request) and b"no_such_frame" in request.body


def _order(request: Request) -> bool:
    return deliveries(request) or _ORDERS(request)


def _cancel(request: Request, forward: Forward) -> None:
    send_own(request, forward, "DELETE", GOAL)


@_mutant("goal-replaced-by-xml", "goal-conflict", "XML with another pose under the active goal's id replaces the goal.")
def _replace_goal(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _is_xml(request) and response.status == 409:
        _cancel(request, forward)
        forward(request)
        return plain(202)(request)
    return response


@_mutant("goal-same-pose", "goal-preempt", "The active goal's pose under another id is a repetition.")
def _same_pose(request: Request, forward: Forward) -> Response:
    known = active(forward, request) if _PUT_GOAL(request) else None
    if known is not None and identity(request) is not None and pose_of(parsed(request.body)) == pose_of(known):
        return plain(200)(request)
    return forward(request)


@_mutant("goal-outcome-of-the-first", "goal-outcome", "A 404 tells of the goal that was replaced, not of the last one.")
class _Outcome:
    def __init__(self) -> None:
        self._replaced = ""

    def __call__(self, request: Request, forward: Forward) -> Response:
        known = active(forward, request) if _PUT_GOAL(request) else None
        response = forward(request)
        if known is not None and response.status in {201, 202}:
            self._replaced = str(known["goal_id"]["id"])
        told: Any = parsed(response.body) if _GET(request) and response.status == 404 else None
        if self._replaced and isinstance(told, dict) and "last_goal" in told:
            told["last_goal"]["goal_id"]["id"] = self._replaced
            response.body = json.dumps(told).encode()
        return response


def _renew(where: Callable[[Request], bool]) -> type[Remembering]:
    """Return a change that sends the last velocity again when a request is refused."""

    class Renewed(Remembering):
        def __call__(self, request: Request, forward: Forward) -> Response:
            response = super().__call__(request, forward)
            if where(request) and response.status >= 400 and self.last and "angular" in self.last:
                send_own(request, forward, "PUT", VELOCITY, self.last)
            return response

    return Renewed


_mutant("safety-renewed-by-406", "safety/hold-ends", "A request that is answered 406 renews the velocity.").made(
    _renew(lambda request: rest("GET", POSE, SENSORS)(request) and "image" in (request.field("Accept") or ""))
)


@_mutant(
    "input-delivery-refused-again",
    "strict-input/delivery-refused",
    "A delivery that is refused for the second time is published.",
    observer=True,
)
class _SecondTime:
    def __init__(self) -> None:
        self._refused: set[str] = set()

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if deliveries(request) and refusal(response):
            if request.target in self._refused:
                path = f"{DELIVERIES}3/depot_x/1/depot_y/2/dest_x/3/dest_y/4/source_x/5/source_y/6"
                send_own(request, forward, "PUT", path)
            self._refused.add(request.target)
        return response


@_mutant("safety-refused-again", "safety/refused-keeps", "A velocity that is refused for the second time is driven.")
class _DrivenAgain:
    def __init__(self) -> None:
        self._refused: set[bytes] = set()

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if _PUTS(request) and refusal(response):
            if request.body in self._refused:
                still = {"x": 0.0, "y": 0.0, "z": 0.0}
                send_own(request, forward, "PUT", VELOCITY, {"linear": {**still, "x": 0.2}, "angular": still})
            self._refused.add(request.body)
        return response


@_mutant("delivery-lost-after-refusal", "equivalence/delivery-rest", "A delivery just after a SOAP fault is lost.",
         interface="both", observer=True)  # fmt: skip
class _Lost:
    def __init__(self) -> None:
        self._fault = False

    def __call__(self, request: Request, forward: Forward) -> Response:
        lost, self._fault = self._fault and deliveries(request), False
        if lost:
            return plain(204)(request)
        response = forward(request)
        self._fault = request.side == "soap" and b"Fault" in response.body
        return response


@_mutant("plan-cached", "plan-start", "A plan that was requested before is the one from before, wherever the robot is.")
class _CachedPlan:
    def __init__(self) -> None:
        self._plans: dict[str, Response] = {}

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not rest("GET", PLAN)(request) or "start_x" in request.target or "xml" in (request.field("Accept") or ""):
            return forward(request)
        if request.target not in self._plans:
            response = forward(request)
            if not success(response):
                return response
            self._plans[request.target] = response.copy()
        return self._plans[request.target].copy()


def _is_zero(request: Request) -> bool:
    value: Any = parsed(request.body) if rest("PUT", VELOCITY)(request) else None
    try:
        return value is not None and not any(value[part][axis] for part in ("linear", "angular") for axis in "xyz")
    except (TypeError, KeyError):
        return False


@_mutant(
    "safety-stop-not-backwards", "safety/stop", "Zero velocity does not stop a robot that drives back and turns right."
)
class _BackwardsRight(Remembering):
    def __call__(self, request: Request, forward: Forward) -> Response:
        last = self.last if _is_zero(request) else None
        if isinstance(last, dict) and "angular" in last and "linear" in last:
            with contextlib.suppress(TypeError, KeyError):
                if last["linear"]["x"] < 0 and last["angular"]["z"] < 0:
                    return plain(204)(request)
        return super().__call__(request, forward)


@_mutant("sensors-twice-after-406", "sensors-unique", "The list after one that was answered 406 has an entry twice.")
class _Twice:
    def __init__(self) -> None:
        self._refused = False

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if rest("GET", SENSORS)(request):
            value: Any = parsed(response.body) if self._refused and success(response) else None
            if isinstance(value, list):
                response.body = json.dumps([*value, *value[:1]]).encode()
            self._refused = response.status == 406
        return response


class _Lingering:
    """GetGoal returns a goal that is no more, until something ends it for this one too."""

    def __init__(self, ends: Callable[[Request], bool]) -> None:
        self._ends = ends
        self._last: Response | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if self._ends(request) and success(response):
            self._last = None
        if soap("GetGoal")(request):
            if b"target_pose" in response.body:
                self._last = response.copy()
            elif self._last is not None:
                return self._last.copy()
        return response


class _LostAfter:
    """The first command after a refusal, or after a SOAP message, is answered and lost."""

    def __init__(self, lost: Callable[[Request], bool], *, soap_message: bool = False) -> None:
        self._lost, self._soap, self._spoilt = lost, soap_message, False

    def __call__(self, request: Request, forward: Forward) -> Response:
        if self._spoilt and self._lost(request) and not _is_zero(request):
            self._spoilt = False
            return plain(204)(request)
        response = forward(request)
        self._spoilt |= request.side == "soap" if self._soap else refusal(response) and request.method != "GET"
        return response
