"""Scenarios on services: a gateway whose servers respond, respond late or never, leave and come back.

Times are s of the monotonic clock, which all processes of a machine share.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import Definition, value_at
from conformance.scenarios.ros.gateway import CROWD, PACE_S, Gateway
from conformance.scenarios.ros.retries import Retry, retries
from conformance.scenarios.ros.robot import Heard
from conformance.scenarios.ros.samples import Kind, Maker, Sample
from conformance.scenarios.ros.web import TRIES, document_of, gave_up, is_out_of_range, is_success
from conformance.scenarios.scenario import NotDeclaredError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.ros_map import Calls, Lists, Reads
from conformance.transport.exchange import Attempt, Exchange
from conformance.transport.parallel import crowd, meanwhile
from conformance.verdict.effort import Effort

#: Why a scenario cannot be played where there is a real robot.
NO_PLAY: Final = "the suite is not the robot, whose servers it would order: --ros-play"
_NEEDS: Final = (Need.REST,)
# Share of the gateway's time limit that a slow server takes.
_SLOW: Final = 0.2
# How long the suite waits for surplus messages, s.
_MORE_S: Final = 0.15
# How much later than declared a response may come, s.
_LATE_S: Final = 2.0
#: Tries if a call delays other clients, because a single delay may be chance.
ROUNDS: Final = 2
#: Reads during a call.
_BESIDE: Final = 4
# A request is held up if it takes _HELD_S, s, and _HELD times its usual time.
_HELD_S, _HELD = 0.8, 5.0
# A request that a call holds up ends at most this long before the call's response, s.
_TOGETHER_S: Final = 0.25
_OVERTAKEN_S: Final = 0.1  # every second concurrent call is answered this much earlier than the others, s
_FEW: Final = 4  # concurrent calls at quick
_CALLS: Final = {"quick": 3, "standard": 6, "deep": 24}  # calls, each with values of its own
_ROW: Final = {"quick": 10, "standard": 20, "deep": 1000}  # calls in a row that show whether clients are never closed


class Server(StrEnum):
    """How a server handles a call."""

    MISSING = "which is not there"
    RESPONDS = "which responds at once"
    SLOW = "which is slow"
    SILENT = "which never responds"
    AFTER = "which responds after a call that it never responded to"
    GONE = "which is gone"
    BACK = "which is back"


@dataclass(frozen=True)
class Beside:
    """A request to another resource while a call is without a response.

    Attributes:
        operation: the operation.
        attempt: what came.
        took, usual: how long that took, and what it takes otherwise, s.
        ended: when it came.
    """

    operation: str
    attempt: Attempt
    took: float
    usual: float
    ended: float


@dataclass(frozen=True)
class Called:
    """A call of a service, and its course at both ends.

    Attributes:
        operation: the operation.
        body: its map.
        server: what the server did.
        request, answer: JSON of what was sent, and of what the server responded; empty if there is none.
        attempt: what the gateway responded.
        ended: when it came.
        heard: what the server got.
        beside: requests to others at that time.
    """

    operation: str
    body: Calls
    server: Server
    request: str
    answer: str
    attempt: Attempt
    ended: float
    heard: tuple[Heard, ...] = ()
    beside: tuple[Beside, ...] = ()

    @property
    def is_success(self) -> bool:
        """Return whether the gateway reports that the service responded."""
        return is_success(self.attempt, self.body)

    @property
    def is_refused(self) -> bool:
        """Return whether the gateway refused the request as invalid, and called no service."""
        return not self.heard and is_out_of_range(self.attempt, self.body)

    @property
    def is_open(self) -> bool:
        """Whether the gateway said nothing of the outcome until the suite gave up."""
        return not isinstance(self.attempt, Exchange) or runs(self.attempt, self.body)


def runs(attempt: Attempt, body: Calls) -> bool:
    """Return whether a call still goes on, as the gateway says."""
    return (
        isinstance(attempt, Exchange)
        and attempt.response.ok
        and body.state is not None
        and value_at(document_of(attempt.response.body).value, body.state.at) in body.state.running
    )


def is_held(call: Called, beside: Beside) -> bool:
    """Return whether a request was held up until a call had ended."""
    together = beside.ended >= call.ended - _TOGETHER_S
    return together and beside.took > max(_HELD_S, _HELD * beside.usual)


@dataclass(frozen=True)
class Crowd:
    """Calls of many clients at once.

    Attributes:
        operation: the operation.
        body: its map.
        requests: JSON of what was sent.
        attempts: what the gateway responded to each.
        heard: what the server got and responded.
    """

    operation: str
    body: Calls
    requests: tuple[str, ...]
    attempts: tuple[Attempt, ...]
    heard: tuple[Heard, ...]


@dataclass(frozen=True)
class Clients:
    """How many clients more a service had after calls in a row.

    Attributes:
        body: its map.
        count: how many calls.
        more: how many clients more it had after them.
        attempt: the last call's response.
    """

    body: Calls
    count: int
    more: int
    attempt: Attempt


@dataclass(frozen=True)
class Services:
    """Calls, and definitions of their responses, by operation."""

    probes: tuple[Called, ...]
    responses: dict[str, Definition]
    crowds: tuple[Crowd, ...] = ()
    clients: tuple[Clients, ...] = ()
    retries: tuple[Retry, ...] = ()


@scenario(needs=_NEEDS, leaves=Leaves.AT_REST, stage=Stage.ACTING)
def service_calls(gateway: Gateway, effort: Effort) -> Services:
    """Serve services well, late, never and not at all, and call them through the gateway."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    probes: list[Called] = []
    responses: dict[str, Definition] = {}
    crowds: list[Crowd] = []
    clients: list[Clients] = []
    retried: list[Retry] = []
    with partial_trace(lambda: Services(tuple(probes), responses)):
        for call, body in gateway.of(Calls):
            request = gateway.definition(f"{body.type}#Request")
            responses[call] = gateway.definition(f"{body.type}#Response")
            with gateway.robot.publishing(body.service):
                caller = _Caller(gateway, call, body, request, responses[call])
                probes.extend(caller.calls(effort))
                clients.append(caller.in_a_row(_ROW[effort.name]))
                retried.extend(retries(gateway, call, body, prepare=caller.delay))
                crowds.append(caller.of_many(_FEW if effort.name == "quick" else CROWD))
    return Services(tuple(probes), responses, tuple(crowds), tuple(clients), tuple(retried))


class _Caller:
    def __init__(self, gateway: Gateway, call: str, body: Calls, request: Definition, response: Definition) -> None:
        self._gateway, self._call, self._body = gateway, call, body
        self._requests, self._responses = gateway.maker(request), gateway.maker(response)
        self._usual_s: list[float] = []

    def calls(self, effort: Effort) -> Iterator[Called]:
        """Yield calls of a server in each of its states."""
        finite = (self._finite(maker, _CALLS[effort.name]) for maker in (self._requests, self._responses))
        pairs = zip(*finite, strict=False)
        yield self._call_server(Server.MISSING, {})
        self._serve([{"answer": {}}])
        yield self._reach_server(Server.RESPONDS)
        self._gateway.send_texts(self._call, self._body)
        yield from (self._call_answering(Server.RESPONDS, *pair) for pair in pairs)
        yield self._call_answering(Server.SLOW, *self._usual(), self._body.within_s * _SLOW)
        yield self._call_answering(Server.AFTER, *self._usual())
        for _ in range(ROUNDS):
            silent = self._never_answered()
            yield silent
            if not silent.is_open or self._body.timeout_s:
                # Without the usual call, the gateway may rightly wait for the first one.
                yield self._call_answering(Server.AFTER, *self._usual())
            if not any(is_held(silent, beside) for beside in silent.beside):
                break
        self._gateway.robot.tell("forget", name=self._body.service)
        yield self._call_server(Server.GONE, {})
        self._serve([{"answer": {}}])
        yield self._reach_server(Server.BACK)

    def in_a_row(self, number: int) -> Clients:
        """Call one call after another, and count the service's clients."""
        robot, body = self._gateway.robot, self._body
        robot.tell("script", name=body.service, script=[{"answer": {}}])
        made = self._gateway.request(self._call, body, self._complete("Request", {}))
        attempt, before = self._gateway.attempt(made, body.within_s + _LATE_S), robot.count_clients(body.service)
        for _ in range(number):
            attempt = self._gateway.attempt(made, body.within_s + _LATE_S)
        # A client that leaves late leaves all the same.
        until = WALL_CLOCK.now() + body.within_s
        while (more := robot.count_clients(body.service) - before) > 1 and WALL_CLOCK.now() < until:
            WALL_CLOCK.sleep(PACE_S)
        return Clients(body, number, more, attempt)

    def of_many(self, number: int) -> Crowd:
        """Call from many clients at once. It comes last, as calls that were given up may still reach the server."""
        robot, body = self._gateway.robot, self._body
        requests = [self._gateway.usual(f"{body.type}#Request") for _ in range(number)]
        script = [
            {"answer": self._gateway.usual(f"{body.type}#Response"), "delay_s": _OVERTAKEN_S * (turn % 2)}
            for turn in range(number)
        ]
        robot.tell("script", name=body.service, script=[*script, {}])
        robot.take_heard(body.service)
        made = [[self._gateway.request(self._call, body, request)] for request in requests]
        attempts = [(self._outcome(one),) for (one,) in crowd(self._gateway.api.client, made, body.within_s + _LATE_S)]
        heard = tuple(robot.take_heard(body.service, 2 * number, _MORE_S))
        return Crowd(self._call, body, tuple(map(json.dumps, requests)), tuple(one for (one,) in attempts), heard)

    def delay(self, delay_s: float) -> None:
        """Have the server respond to the next call so late, s."""
        script = [{"answer": {}, "delay_s": delay_s}, {"answer": {}}]
        self._gateway.robot.tell("script", name=self._body.service, script=script)

    def _serve(self, script: list[dict[str, Any]]) -> None:
        self._gateway.robot.tell("serve", service=self._body.service, type=self._body.type, script=script)

    def _complete(self, part: str, value: dict[str, Any]) -> dict[str, Any]:
        return self._gateway.complete(f"{self._body.type}#{part}", value)

    def _reach_server(self, server: Server) -> Called:
        """Call until the gateway has found the server, or its time is over."""
        until = WALL_CLOCK.now() + 2 * self._body.within_s
        while True:
            called = self._call_server(server, {}, self._complete("Response", {}))
            if called.is_success or WALL_CLOCK.now() > until:
                return called
            WALL_CLOCK.sleep(PACE_S)

    def _call_answering(self, server: Server, request: Sample, answer: Sample, delay_s: float = 0.0) -> Called:
        """Call a server that gives a response of its own to this call."""
        complete = self._complete("Response", answer.value)
        script = [{"answer": complete, "delay_s": delay_s}, {"answer": {}}]
        for _ in range(TRIES):
            self._gateway.robot.tell("script", name=self._body.service, script=script)
            called = self._call_server(server, request.value, complete)
            if not gave_up(called.attempt, self._body):
                break
        self._requests.is_gentle |= called.is_refused
        return called

    def _usual(self) -> tuple[Sample, Sample]:
        return self._requests.usual(), self._responses.usual()

    @staticmethod
    def _finite(maker: Maker, most: int) -> Iterator[Sample]:
        """Yield samples without NaN and infinities, which a gateway may refuse."""
        return (sample for sample in maker.samples(most, large=0) if sample.kind is not Kind.NON_FINITE)

    def _call_server(self, server: Server, request: dict[str, Any], answer: dict[str, Any] | None = None) -> Called:
        robot, body = self._gateway.robot, self._body
        request = self._complete("Request", request)
        robot.take_heard(body.service)
        attempt = self._outcome(
            self._gateway.attempt(self._gateway.request(self._call, body, request), body.within_s + _LATE_S)
        )
        ended = WALL_CLOCK.now()
        heard = () if answer is None else tuple(robot.take_heard(body.service, 3, _MORE_S))
        text = "" if answer is None else json.dumps(answer)
        return Called(self._call, body, server, json.dumps(request), text, attempt, ended, heard)

    def _outcome(self, attempt: Attempt) -> Attempt:
        """Return the last reading of a call that goes on after its response, or the response itself."""
        state, until = self._body.state, WALL_CLOCK.now() + self._body.within_s + _LATE_S
        if state is None or not isinstance(attempt, Exchange) or not attempt.response.ok:
            return attempt
        made = self._gateway.following(attempt, self._body, state.read, state.body)
        while made is not None:
            attempt = self._gateway.attempt(made, self._body.within_s)
            if not runs(attempt, self._body) or WALL_CLOCK.now() > until:
                break
            WALL_CLOCK.sleep(PACE_S)
        return attempt

    def _never_answered(self) -> Called:
        """Call a server that never responds, and read other resources until the gateway gives the call up."""
        robot, body = self._gateway.robot, self._body
        others = self._others()
        # Measured once, because later a call may hold up all others.
        self._usual_s = self._usual_s or [self._read(call, read, 0.0).took for call, read in others]
        request = self._gateway.usual(f"{body.type}#Request")
        robot.tell("script", name=body.service, script=[{"never": True}])
        robot.take_heard(body.service)
        made, text = self._gateway.request(self._call, body, request), json.dumps(request)
        with meanwhile(self._gateway.api.client, made, body.within_s + _LATE_S) as hanging:
            heard = robot.take_heard(body.service, 1, body.within_s)
            beside = tuple(
                self._read(call, read, took) for (call, read), took in zip(others, self._usual_s, strict=True) if heard
            )
        attempt, ended = hanging.result()
        outcome = self._outcome(attempt)
        ended = ended if outcome is attempt else WALL_CLOCK.now()
        return Called(self._call, body, Server.SILENT, text, "", outcome, ended, tuple(heard), beside)

    def _others(self) -> list[tuple[str, Reads | Lists]]:
        others = [(call, one) for call, one in self._gateway.ros.operations.items() if isinstance(one, Reads | Lists)]
        return [pair for pair in others if isinstance(pair[1], Lists) or pair[1].stream in {"", "rosbridge"}][-_BESIDE:]

    def _read(self, call: str, read: Reads | Lists, usual: float) -> Beside:
        began = WALL_CLOCK.now()
        made = self._gateway.binding.make(call, None) if isinstance(read, Lists) else self._gateway.request(call, read)
        attempt = self._gateway.attempt(made, self._body.within_s + 2 * _LATE_S)
        ended = WALL_CLOCK.now()
        return Beside(call, attempt, ended - began, usual, ended)
