"""Scenarios on parameters of nodes: their values, as the web shows and sets them, and what a node refuses.

Times are s of the monotonic clock, which all processes of a machine share.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import Definition
from conformance.scenarios.ros.gateway import PACE_S, PATIENCE_S, Gateway
from conformance.scenarios.ros.samples import Kind
from conformance.scenarios.ros.services import NO_PLAY
from conformance.scenarios.ros.web import differences, document_of, equal, is_out_of_range, is_success, with_texts
from conformance.scenarios.scenario import NotDeclaredError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.ros_map import Parameter, is_setter
from conformance.transport.exchange import Exchange, Outgoing
from conformance.verdict.effort import Effort

# Names in a message for the types of items.
_ITEMS: Final = {"bool": "boolean", "integer": "int64", "double": "double", "string": "string", "byte": "octet"}
_SAMPLES: Final = {"quick": 6, "standard": 12, "deep": 30}
# Time in which surplus requests arrive, s.
_MORE_S: Final = 0.15


class Reaction(StrEnum):
    """What a node does with a request to set its parameter."""

    TAKES = "which the node takes"
    REFUSES = "which the node refuses"
    OTHER_TYPE = "which is of another type"
    MISSING = "whose node is not there"


@dataclass(frozen=True)
class Got:
    """What an operation returned of a parameter.

    Attributes:
        operation: the operation.
        body: its map.
        value: JSON of the parameter as a message with one field; empty if its node is not there.
        exchange: the read that shows it, else the last one.
        was_shown: whether it shows the value.
    """

    operation: str
    body: Parameter
    value: str
    exchange: Exchange
    was_shown: bool


@dataclass(frozen=True)
class Put:
    """A request to set a parameter, and its outcome.

    Attributes:
        operation: the operation.
        body: its map.
        reaction: what the node does.
        value: JSON of what was sent, as a message with one field; empty if it is no value of the type.
        exchange: request and response.
        heard: JSON of what the node was asked to set, each as such a message.
        before, after: JSON of what the node had.
    """

    operation: str
    body: Parameter
    reaction: Reaction
    value: str
    exchange: Exchange
    heard: tuple[str, ...]
    before: str
    after: str


@dataclass(frozen=True)
class Parameters:
    """Reads and writes of parameters, and the definitions of their values, by operation."""

    gets: tuple[Got, ...]
    puts: tuple[Put, ...]
    definitions: dict[str, Definition]


@scenario(needs=(Need.REST,), leaves=Leaves.AT_REST, stage=Stage.ACTING)
def node_parameters(gateway: Gateway, effort: Effort) -> Parameters:
    """Be the nodes of a map, change their parameters and read them, set them, and refuse what is set."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    gets: list[Got] = []
    puts: list[Put] = []
    mapped = dict(gateway.of(Parameter))
    definitions = {call: _definition(body) for call, body in mapped.items()}
    with partial_trace(lambda: Parameters(tuple(gets), tuple(puts), definitions)):
        for call, body in mapped.items():
            with gateway.robot.publishing(body.node):
                end = _End(gateway, call, body, definitions[call])
                if is_setter(call, body):
                    puts.extend(end.sets(_SAMPLES[effort.name]))
                else:
                    gets.extend(end.reads(_SAMPLES[effort.name]))
    return Parameters(tuple(gets), tuple(puts), definitions)


def _definition(body: Parameter) -> Definition:
    """Return the definition of a parameter's value, as a message with one field."""
    item, _, array = body.type.partition("_")
    name = f"parameter/{body.type}"
    return Definition(name, {name: {"value": f"sequence<{_ITEMS[item]}>" if array else _ITEMS[item]}})


@dataclass
class _End:
    gateway: Gateway
    call: str
    body: Parameter
    definition: Definition

    def __post_init__(self) -> None:
        self.maker = self.gateway.maker(self.definition)

    def reads(self, most: int) -> Iterator[Got]:
        """Give the parameter values, and yield what the operation returns; then leave."""
        for value in self.values(most):
            self.hold(value)
            got = self.read_until(value, self.body.within_s + PATIENCE_S)
            yield got
            if not got.was_shown:
                break
        self.gateway.robot.tell("forget", name=self.body.node)
        yield self.read_until(None, self.body.within_s + PATIENCE_S)

    def sets(self, most: int) -> Iterator[Put]:
        """Yield requests that the node takes, refuses, and does not get."""
        first, *values = self.values(most)
        self.hold(first)
        until = WALL_CLOCK.now() + 2 * self.body.within_s + PATIENCE_S
        while not is_success((put := self.put(Reaction.TAKES, first)).exchange, self.body) and WALL_CLOCK.now() < until:
            self.maker.is_gentle |= is_out_of_range(put.exchange, self.body)
            first = self.maker.usual().value
            WALL_CLOCK.sleep(PACE_S)
        yield put
        yield from (self.put(Reaction.TAKES, value) for value in values)
        made = self.request(self.maker.usual().value)
        if self.gateway.binding.syntax == "JSON" and self.maker.has_numbers:
            yield self.put(Reaction.OTHER_TYPE, None, self.with_text(made))
        self.hold(self.maker.usual().value, refuses=True)
        yield self.put(Reaction.REFUSES, self.maker.usual().value)
        self.gateway.robot.tell("forget", name=self.body.node)
        yield self.put(Reaction.MISSING, self.maker.usual().value)

    def values(self, most: int) -> Iterator[dict[str, Any]]:
        """Yield values of the parameter's type, extreme ones among them."""
        for sample in self.maker.samples(most, large=0):
            if sample.kind not in {Kind.DEFAULT, Kind.NON_FINITE}:
                yield sample.value

    def hold(self, value: dict[str, Any], *, refuses: bool = False) -> None:
        """Be the node whose parameter has a value."""
        held = {self.body.parameter: [self.body.type, value["value"]]}
        self.gateway.robot.tell("hold", node=self.body.node, values=held, refuses=refuses)

    def request(self, value: dict[str, Any] | None) -> Outgoing:
        """Return the request; with a value, one that sets it."""
        return self.gateway.request(self.call, self.body, value, self.definition)

    def read_until(self, value: dict[str, Any] | None, within_s: float) -> Got:
        """Read until the operation shows a value, or that there is none."""
        until = WALL_CLOCK.now() + within_s
        while True:
            exchange = self.gateway.send(self.request(None), self.body.response_s)
            is_there = is_success(exchange, self.body)
            if value is None:
                is_shown = not is_there
            else:
                document = document_of(exchange.response.body)
                found = differences(document, value, self.definition, self.body, self.gateway.ros)
                is_shown = is_there and not found
            if is_shown or WALL_CLOCK.now() > until:
                text = "" if value is None else json.dumps(value)
                return Got(self.call, self.body, text, exchange, is_shown)
            WALL_CLOCK.sleep(PACE_S)

    def put(self, reaction: Reaction, value: dict[str, Any] | None, made: Outgoing | None = None) -> Put:
        """Send a request to set the parameter."""
        robot, node, before = self.gateway.robot, self.body.node, self.value_at_node(reaction)
        robot.take_heard(node)
        exchange = self.gateway.send(made or self.request(value), self.body.response_s)
        count = int(is_success(exchange, self.body)) + 1
        heard = robot.take_heard(node, count, _MORE_S)
        values = tuple(json.dumps({"value": each.content.get(self.body.parameter)}) for each in heard)
        text = "" if value is None else json.dumps(value)
        return Put(self.call, self.body, reaction, text, exchange, values, before, self.value_at_node(reaction))

    def value_at_node(self, reaction: Reaction) -> str:
        """Return JSON of what the node has."""
        if reaction is Reaction.MISSING:
            return ""
        held = self.gateway.robot.tell("held", node=self.body.node)["values"]
        return json.dumps({"value": held[self.body.parameter]})

    def with_text(self, made: Outgoing) -> Outgoing:
        """Return a request with texts in place of the value's numbers."""
        return replace(made, body=with_texts(made.body, self.body))


def is_same(value: str, other: str) -> bool:
    """Return whether two values of a parameter are equal, both as JSON of a message with one field."""
    return equal(json.loads(value), json.loads(other))
