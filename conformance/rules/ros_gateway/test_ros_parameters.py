"""Rules on parameters of nodes: the gateway shows and sets their values, and reports what a node refuses."""

from __future__ import annotations

import json
from collections.abc import Iterator

from conformance.rules.ros_gateway.judging import fails_as, statuses
from conformance.scenarios.ros.parameters import Got, Parameters, Put, Reaction, is_same, node_parameters
from conformance.scenarios.ros.web import differences, document_of, is_out_of_range, is_success
from conformance.scenarios.rule import Outcome, rule
from conformance.statement.ros_map import RosMap
from conformance.verdict.evidence import Case


@rule("ros-gateway/parameter-exact", on=(node_parameters,))
def exact(trace: Parameters, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether a parameter is read as its node has it, and set once, as the request has it."""
    for got in trace.gets:
        if got.value:
            yield _judge_read(got, trace, ros)
    for put in trace.puts:
        if put.reaction is Reaction.TAKES:
            yield from _judge_set(put)


def _judge_read(got: Got, trace: Parameters, ros: RosMap) -> Case:
    body, document = got.body, document_of(got.exchange.response.body)
    found = differences(document, json.loads(got.value), trace.definitions[got.operation], body, ros)
    own, web = (found[0].ros, found[0].web) if found else ("", "")
    expected = f"the value of {body.parameter} of {body.node}{f', {own}' if own else ''}"
    return Case(got.was_shown, got.exchange, expected, web, got.operation)


def _judge_set(put: Put) -> Iterator[Outcome]:
    body, done = put.body, is_success(put.exchange, put.body)
    place = f"{body.parameter} of {body.node}"
    if not done:
        # A gateway may have limits of its own; then the node is not asked.
        holds = is_out_of_range(put.exchange, body) and not put.heard
        yield Case(holds, put.exchange, f"2xx, as the node took {place}", cause=f"{put.operation} told as refused")
        return
    found = f"{len(put.heard)} requests at the node" if len(put.heard) != 1 else ""
    yield Case(not found, put.exchange, f"one request to set {place}", found, f"{put.operation} once")
    if put.heard:
        found = "" if is_same(put.after, put.value) else f"{put.after} at the node"
        expected = f"{place} as it was sent, {put.value}"
        yield Case(not found, put.exchange, expected, found, f"{put.operation} changed")


@rule("ros-gateway/parameter-refused", on=(node_parameters,))
def refusals(trace: Parameters) -> Iterator[Outcome]:
    """Judge whether a value that the node refuses or does not receive is reported as a failure and changes nothing."""
    for got in trace.gets:
        if not got.value:
            yield _failure(got, f"{got.body.parameter} of {got.body.node}, {Reaction.MISSING}")
    for put in trace.puts:
        if put.reaction is not Reaction.TAKES:
            yield _failure(put, f"{put.body.parameter} of {put.body.node}, {put.reaction}")
            changed = "" if put.before == put.after else f"{put.after} in place of {put.before}"
            yield Case(not changed, put.exchange, "the parameter as it was before", changed, f"{put.operation} kept")


def _failure(one: Got | Put, what: str) -> Case:
    body = one.body
    declared = body.refused if isinstance(one, Put) and one.reaction is Reaction.REFUSES else ()
    holds = fails_as(one.exchange, body, declared)
    return Case(holds, one.exchange, f"{statuses(declared)} for {what}", cause=f"{one.operation} {what}")
