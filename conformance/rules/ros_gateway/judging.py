"""Shared functions of the rules on gateways."""

from __future__ import annotations

import json
from collections.abc import Sequence

import msgspec

from conformance.rules.ros_gateway.arrivals import Request, counts
from conformance.scenarios.ros.definition import Definition
from conformance.scenarios.ros.retries import Retry
from conformance.scenarios.ros.web import changes, differences, document_of, fields_in, is_success
from conformance.scenarios.rule import NotTested, Outcome
from conformance.statement.ros_map import Body, RosMap
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case


def differing(exchange: Exchange, value: str, definition: Definition, body: Body, at: str, ros: RosMap) -> str:
    """Return how a part of a response is not a ROS message; empty if it is.

    Args:
        exchange: with the response.
        value: JSON of the message.
        definition: the definition of its type.
        body: how the operation writes messages.
        at: where the part is.
        ros: how the gateway writes values.
    """
    part = msgspec.structs.replace(body, at=at, fields={})
    found = differences(document_of(exchange.response.body), json.loads(value), definition, part, ros)
    return f"{found[0].at} is {found[0].web} in place of {found[0].ros}" if found else ""


def change_text(content: dict[str, object], sent: str, body: Body) -> str:
    """Return how what arrived is not the message that was sent; empty if it is."""
    found = next(changes(fields_in(content, body), fields_in(json.loads(sent), body)), None)
    return f"{found[0]} is {found[1]} in place of {found[2]}" if found else ""


def judge_retry(one: Retry) -> Outcome:
    """Judge whether equal requests and retries arrived as often as they were accepted."""
    requests = [Request(key, None, accepted) for key, accepted in one.accepted.items()]
    _, came, least, most = next(counts(requests, [None] * one.came))
    if came < least and not one.reliable:
        return NotTested(f"of {one.how}, some of {one.end} may be lost on the way")
    number = f"{least} to {most}" if least < most else f"{most}"
    expected = f"{number} at {one.end} for {one.how}"
    return Case(least <= came <= most, one.last, expected, f"{came}", f"{one.operation} {one.how}")


def fails_as(exchange: Exchange, body: Body, declared: Sequence[int]) -> bool:
    """Return whether a response reports a failure: by a declared or any error status, or in a 2xx by the map."""
    response = exchange.response
    return not is_success(exchange, body) and (response.ok or not declared or response.status in declared)


def statuses(declared: Sequence[int]) -> str:
    """Return which statuses a gateway may respond, as a noun phrase."""
    return f"status {' or '.join(map(str, declared))}" if declared else "an error status"
