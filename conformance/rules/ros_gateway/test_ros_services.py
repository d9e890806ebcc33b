"""Rules on service calls of a gateway: it calls as requested, and reports each outcome."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, Final

from conformance.rules.ros_gateway.arrivals import Request, counts
from conformance.rules.ros_gateway.judging import change_text, differing, fails_as, judge_retry, statuses
from conformance.scenarios.ros.definition import Definition
from conformance.scenarios.ros.services import ROUNDS, Called, Crowd, Server, Services, is_held, service_calls
from conformance.scenarios.ros.web import fields_in, is_success
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.statement.ros_map import Body, RosMap
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

_RESPONDS: Final = (Server.RESPONDS, Server.SLOW, Server.AFTER)
_ABSENT: Final = (Server.MISSING, Server.GONE, Server.SILENT)


@rule("ros-gateway/service-response", on=(service_calls,))
def responses(trace: Services, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether each call returns the server's response."""
    for call in trace.probes:
        if call.server not in _RESPONDS or not call.answer:
            continue
        ok, body, found = call.is_success, call.body, ""
        if call.is_refused or (not ok and call.server is not Server.RESPONDS):
            # A gateway may have limits, and may give a slow server up; what follows is judged by recovery.
            continue
        if ok and isinstance(call.attempt, Exchange):
            found = differing(call.attempt, call.answer, trace.responses[call.operation], body, body.result, ros)
        expected = f"2xx with the response of {body.service}, {call.server}"
        yield Case(ok and not found, call.attempt, expected, found, f"{call.server} {found.split(' ')[0]}")
    for crowd in trace.crowds:
        yield from _own(crowd, trace.responses[crowd.operation], ros)


def _own(crowd: Crowd, definition: Definition, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether each of many clients gets the response to its own call, also if calls are equal."""
    body, left = crowd.body, defaultdict[str, list[str]](list)
    for message in crowd.heard:
        if message.what == "response":
            left[_key(message.content["request"], body)].append(json.dumps(message.content["response"]))
    for request, attempt in zip(crowd.requests, crowd.attempts, strict=True):
        if isinstance(attempt, Exchange) and is_success(attempt, body):
            own = left[_key(json.loads(request), body)]
            fits = next((one for one in own if not differing(attempt, one, definition, body, body.result, ros)), None)
            expected = f"the response of {body.service} to this call, one of {len(crowd.requests)} at once"
            yield Case(fits is not None, attempt, expected, observed="another one", cause="another")
            if fits is not None:
                own.remove(fits)


def _key(request: dict[str, Any], body: Body) -> str:
    return json.dumps(fields_in(request, body))


@rule("ros-gateway/service-once", on=(service_calls,))
def once(trace: Services) -> Iterator[Outcome]:
    """Judge whether a successful call reached the server unchanged, and exactly once."""
    for call in trace.probes:
        if call.server not in _RESPONDS or not call.answer or not call.is_success:
            continue
        requests = [heard for heard in call.heard if heard.what == "request"]
        expected, cause = f"one call of {call.body.service} for one accepted request", "doubled" if requests else "lost"
        yield Case(len(requests) == 1, call.attempt, expected, f"{len(requests)} calls", cause)
        if requests:
            found = change_text(requests[0].content, call.request, call.body)
            yield Case(not found, call.attempt, f"the request's fields at {call.body.service}", found, "changed")
    for crowd in trace.crowds:
        yield from _judge_reach(crowd)
    yield from map(judge_retry, trace.retries)


def _judge_reach(crowd: Crowd) -> Iterator[Outcome]:
    """Judge whether of many calls at once none reaches the server twice, and each that succeeds does once."""
    body = crowd.body
    # One that failed may have reached the server.
    requests = [
        Request(attempt, _key(json.loads(request), body), is_success(attempt, body) or None)
        for request, attempt in zip(crowd.requests, crowd.attempts, strict=True)
    ]
    heard = [_key(message.content, body) for message in crowd.heard if message.what == "request"]
    for one, came, least, most in counts(requests, heard):
        calls = f"{least} to {most}" if least < most else f"{most}"
        expected = f"{calls} calls of {body.service} for {most} equal requests, {len(requests)} requests at once"
        cause = "lost" if came < least else "doubled"
        yield Case(least <= came <= most, one.sent, expected, f"{came} calls", cause)


@rule("ros-gateway/service-failure", on=(service_calls,))
def failures(trace: Services) -> Iterator[Outcome]:
    """Judge whether a call without a response is reported as a failure in time, by a declared status."""
    for call in trace.probes:
        if call.server not in _ABSENT or (call.server is Server.SILENT and not call.heard):
            continue
        body = call.body
        gone = body.unavailable and (*body.unavailable, *body.too_late)
        declared = body.too_late if call.server is Server.SILENT else gone
        expected = f"{statuses(declared)} within {body.within_s:g} s for {body.service}, {call.server}"
        if call.is_open and body.timeout_s is None:
            yield NotClaimed(f"the map does not say how long a call of {body.service} may take: `timeout_s`")
            continue
        if call.is_open or not isinstance(call.attempt, Exchange):
            yield Case(holds=False, exchange=call.attempt, expected=expected, cause=f"{call.server} silent")
            continue
        holds, status = fails_as(call.attempt, body, declared), call.attempt.response.status
        yield Case(holds, call.attempt, expected, cause=f"{call.server} {status}")


@rule("ros-gateway/others-served", on=(service_calls,))
def others(trace: Services) -> Iterator[Outcome]:
    """Judge whether other resources respond while a call has no response; each must be held up in all rounds."""
    rounds: dict[str, list[Called]] = {}
    for one in trace.probes:
        # If a call reaches no service and gets no response, an earlier call has stopped the gateway for good.
        is_dead = one.operation in rounds and not isinstance(one.attempt, Exchange)
        if one.server is Server.SILENT and (one.heard or is_dead):
            rounds.setdefault(one.operation, []).append(one)
    for calls in rounds.values():
        held = [next((beside for beside in call.beside if is_held(call, beside)), None) for call in calls]
        shown = next((beside for beside in (*held, *calls[0].beside) if beside is not None), None)
        is_held_up = all(beside or not one.heard for beside, one in zip(held, calls, strict=True))
        if shown is None:
            read = any(one.heard for one in calls)
            none = NotClaimed("the map has no operation that reads")
            yield none if read else NotTested("no other operation was read while a service did not respond")
            continue
        expected = f"a response while {calls[0].operation} waits for {calls[0].body.service}"
        found = f"a response after {shown.took:.1f} s, when that call had ended; usually {shown.usual:.2f} s"
        yield Case(not is_held_up or len(held) < ROUNDS, shown.attempt, expected, found, shown.operation)


@rule("ros-gateway/recovers", on=(service_calls,))
def recovers(trace: Services) -> Iterator[Outcome]:
    """Judge whether a service that was gone is called again, and whether the gateway survives a silent one."""
    for call in trace.probes:
        if call.server in {Server.BACK, Server.AFTER}:
            yield Case(call.is_success, call.attempt, f"2xx for {call.body.service}, {call.server}", cause=call.server)
