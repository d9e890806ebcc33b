"""Scenarios on publishers that are absent, fall silent, are killed and come back; and on the graph.

Times are s of the monotonic clock, which all processes of a machine share.
"""

from __future__ import annotations

import itertools
import secrets
import time
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import Any, Final

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import value_at
from conformance.scenarios.ros.gateway import PACE_S, PATIENCE_S, Gateway, exchange_of
from conformance.scenarios.ros.services import NO_PLAY
from conformance.scenarios.ros.web import content_of, differences, document_of, is_success
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.ros_map import Lists, Publishes, Reads, end_of
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort

_NEEDS: Final = (Need.REST,)
_REPEAT_S: Final = 0.1
# For a message on its way, and a late gateway: wait this long after a message's greatest age, s.
_LATE_S: Final = 1.0
_ROUNDS: Final = 5
# Reads of all topics, and clients of a stream, that show whether subscriptions are never closed.
_READS: Final = {"quick": 20, "standard": 200, "deep": 10_000}
_CLIENTS: Final = 6
# Topics by which the graph grows, and types of which one is no other topic's.
_TOPICS: Final = {"quick": 30, "standard": 300, "deep": 300}
_OTHERS: Final = ("std_msgs/msg/ColorRGBA", "std_msgs/msg/Empty")


@dataclass(frozen=True)
class Absence:
    """An operation's response without a message, or with none that is young enough.

    Attributes:
        body: its map.
        when: as a noun phrase.
        exchange: the last read.
        first: the read that was made when there was a message; None if there never was any.
    """

    body: Reads
    when: str
    exchange: Exchange
    first: Exchange | None = None


@dataclass(frozen=True)
class Presence:
    """What an operation returned of a publisher of some quality of service.

    Attributes:
        publisher: as a noun phrase.
        shown: whether its message was returned in time, or a new one that is no other topic's: that the gateway
            changes messages is another matter.
        exchange: the read that shows it, else the last one.
        instead: the topic whose message was returned; empty if there is none.
    """

    publisher: str
    shown: bool
    exchange: Exchange
    instead: str = ""


@dataclass(frozen=True)
class Publishers:
    """The reads while publishers fell silent, were killed and came back."""

    absences: tuple[Absence, ...]
    presences: tuple[Presence, ...]


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.READING)
def topics_at_first(gateway: Gateway) -> tuple[Absence, ...]:
    """Read topics on which nothing was published yet."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    also = {publishes.publishes for publishes in gateway.ros.operations.values() if isinstance(publishes, Publishes)}
    found = []
    for call, body in gateway.of(Reads):
        if body.topic in also or gateway.robot.count(body.topic, "publishers"):
            continue
        # Messages of an earlier run may still be published.
        exchange = _read_until(gateway, call, body, WALL_CLOCK.now() + (body.max_age_s or 0.0) + _LATE_S)
        found.append(Absence(body, "on which nothing was published", exchange))
    if not found:
        raise NotPossibleError("each topic has a publisher")
    return tuple(found)


def _read_until(gateway: Gateway, call: str, body: Reads, until: float, old: str | None = None) -> Exchange:
    """Read until there is no message, or, after an ``old`` one, another; or until a time. Return the last read."""
    while True:
        exchange = gateway.read(call, body)
        is_new = is_success(exchange, body) and content_of(exchange, body) != old
        if is_new is (old is not None) or WALL_CLOCK.now() > until:
            return exchange
        WALL_CLOCK.sleep(PACE_S)


# Late, because a killed publisher stays on the graph until its lease ends, and a gateway may count it.
@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.LATE)
def publishers_end(gateway: Gateway) -> Publishers:
    """Publish on all topics, pause, publish again, leave, return, be killed, and start again."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    topics = _Topics(gateway)
    absences: list[Absence] = []
    presences = list(topics.publish_all("all topics at once"))
    absences += topics.let_age("whose publisher fell silent", topics.silence)
    presences += topics.publish_all("a publisher that fell silent before")
    absences += topics.let_age("whose publisher left", topics.leave)
    presences += topics.publish_all("a publisher in place of one that left")
    topics.change_type()
    presences += topics.publish_all("a publisher after one of another type")
    absences += topics.let_age("whose publisher was killed", gateway.kill)
    presences += topics.publish_all("a publisher in place of one that was killed")
    topics.end()
    return Publishers(tuple(absences), tuple(presences))


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def publishers_of_each_quality(gateway: Gateway) -> tuple[Presence, ...]:
    """Publish with best effort; then once, latched, before the gateway has found the publisher."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    topics = _Topics(gateway)
    found = [*topics.publish_all("a best-effort publisher", reliability="best_effort")]
    topics.leave()
    # The last message of a latched publisher stays; where one may be too old, it does not.
    aged = {body.topic for _, body in gateway.of(Reads) if body.max_age_s is not None}
    lasting = _Topics(gateway, lambda body: body.topic not in aged)
    # It is older than its discovery.
    found += lasting.publish_all("a latched publisher", repeat_s=0.0, apart=True, durability="transient_local")
    lasting.end()
    return tuple(found)


class _Topics:
    """Topics that are read, all or those that are ``wanted``, each with messages of its own."""

    def __init__(self, gateway: Gateway, wanted: Callable[[Reads], bool] = lambda _: True) -> None:
        self._gateway = gateway
        self._reads = {call: body for call, body in gateway.of(Reads) if wanted(body)}
        self._definitions = {call: gateway.definition(body.type) for call, body in self._reads.items()}

    def publish_all(self, publisher: str, repeat_s: float = _REPEAT_S, **how: Any) -> Iterator[Presence]:
        """Publish on all topics, and yield the gateway's response for each."""
        before = {call: content_of(self._gateway.read(call, body), body) for call, body in self._reads.items()}
        values: dict[str, Any] = {}
        for body in self._reads.values():
            if body.topic not in values:
                value = values[body.topic] = self._message(body.type)
                self._gateway.robot.publish(body.topic, body.type, value, repeat_s=repeat_s, **how)
        until = WALL_CLOCK.now() + max((body.within_s for body in self._reads.values()), default=0.0) + PATIENCE_S
        found: dict[str, Presence] = {}
        for turn in itertools.count(1):
            # In rounds, so that no message gets too old while another is awaited. Several rounds, because a gateway
            # that mixes topics is sometimes right; one message of another topic decides.
            for call in self._reads:
                if call not in found or not found[call].instead or found[call].shown:
                    now = self._presence(call, publisher, values, before[call])
                    if call not in found or now.instead or not found[call].shown:
                        found[call] = now
            is_over = WALL_CLOCK.now() > until
            if is_over or (turn >= _ROUNDS and all(presence.shown or presence.instead for presence in found.values())):
                break
            WALL_CLOCK.sleep(PACE_S)
        yield from found.values()

    def _presence(self, call: str, publisher: str, values: Mapping[str, Any], before: object) -> Presence:
        exchange = self._gateway.read(call, self._reads[call])
        body, kinds = self._reads[call], {mapping.topic: mapping.type for mapping in self._reads.values()}
        if not is_success(exchange, body):
            return Presence(publisher, shown=False, exchange=exchange)
        document, definition = document_of(exchange.response.body), self._definitions[call]
        alike = {topic: value for topic, value in values.items() if kinds[topic] == body.type}
        shows = [t for t, v in alike.items() if not differences(document, v, definition, body, self._gateway.ros)]
        is_new = not shows and content_of(exchange, body) != before
        return Presence(publisher, is_new or body.topic in shows, exchange, next(iter(shows), ""))

    def _message(self, kind: str) -> dict[str, Any]:
        """Return a new message, whose stamp is the present: its age may be read from that."""
        value = self._gateway.usual(kind)
        if "stamp" in value.get("header", {}):
            now = time.time_ns()
            value["header"]["stamp"] = {"sec": now // 10**9, "nanosec": now % 10**9}
        return value

    def silence(self) -> None:
        """Publish no more, and stay."""
        for body in self._reads.values():
            self._gateway.robot.publish(body.topic, body.type)

    def leave(self) -> None:
        """Leave all topics, for long enough that a gateway which looks at the graph now and then notices."""
        self.end()
        WALL_CLOCK.sleep(_LATE_S)

    def end(self) -> None:
        """Leave all topics."""
        for body in self._reads.values():
            self._gateway.robot.tell("forget", name=body.topic)

    def change_type(self) -> None:
        """Publish messages of another type on all topics for a while, and leave."""
        self.leave()
        for topic, kind in {body.topic: body.type for body in self._reads.values()}.items():
            other = next(one for one in _OTHERS if one != kind)
            self._gateway.robot.publish(topic, other, {}, repeat_s=_REPEAT_S, apart=True)
        WALL_CLOCK.sleep(_LATE_S)
        self.leave()

    def let_age(self, when: str, end: Callable[[], object]) -> Iterator[Absence]:
        """Stop publishing, and yield the gateway's responses when the last messages are too old."""
        judged = {call: body for call, body in self._reads.items() if body.max_age_s is not None}
        first: dict[str, Exchange] = {}
        # A busy gateway that shows a last message has read all others; one that gets repeated ones may have some left.
        for repeat_s in (0.0, _REPEAT_S):
            left = [call for call, body in judged.items() if call not in first or not is_success(first[call], body)]
            before = {call: content_of(self._gateway.read(call, judged[call]), judged[call]) for call in left}
            for body in {judged[call].topic: judged[call] for call in left}.values():
                self._gateway.robot.publish(body.topic, body.type, self._message(body.type), repeat_s=repeat_s)
            until = WALL_CLOCK.now() + PATIENCE_S
            first |= {call: _read_until(self._gateway, call, judged[call], until, before[call]) for call in left}
        end()
        ended = WALL_CLOCK.now()
        for call, body in sorted(judged.items(), key=lambda pair: pair[1].max_age_s or 0.0):
            WALL_CLOCK.sleep(max(0.0, ended + (body.max_age_s or 0.0) + _LATE_S - WALL_CLOCK.now()))
            until = WALL_CLOCK.now() + (PATIENCE_S if call in left else 2 * _LATE_S)
            exchange = _read_until(self._gateway, call, body, until)
            yield Absence(body, when, exchange, first[call])


@dataclass(frozen=True)
class Listed:
    """A list's entry for one name.

    Attributes:
        body: its map.
        name: the name, and its type on the graph.
        kind: its type.
        there: whether it is on the graph, and no name that the list leaves out.
        right: whether the list came to say so in time.
        found: what the list last had as its type; empty if there is none.
        exchange: the last read.
    """

    body: Lists
    name: str
    kind: str
    there: bool
    right: bool
    found: str
    exchange: Exchange


# Types of the topics, services and actions that the suite adds to the graph, by what the operation lists.
_KINDS: Final = {
    "topics": "std_msgs/msg/ColorRGBA",
    "services": "std_srvs/srv/Trigger",
    "actions": "nav2_msgs/action/NavigateToPose",
    "nodes": "",
}


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def graph_lists(gateway: Gateway) -> tuple[Listed, ...]:
    """Put names on the graph and take them off again, and read the lists each time."""
    found: list[Listed] = []
    for call, body in gateway.of(Lists):
        kind, part = body.of or _KINDS[body.lists], secrets.token_hex(4)
        names = {f"/roaas_{part}": True, f"/roaas_{part}/inner/name": True}
        # A name that is hidden comes first: when the others are listed, it would be.
        if body.hidden is not None:
            names = {f"/roaas_{part}/_hidden": body.hidden, **names}
        for name in names:
            _put(gateway, body.lists, name, kind)
        for name, there in reversed(names.items()):
            found.append(_read_list(gateway, call, body, name, kind, there=there))
        for name in names:
            gateway.robot.tell("forget", name=name)
        found += [_read_list(gateway, call, body, name, kind, there=False) for name in names]
    return tuple(found)


@dataclass(frozen=True)
class Strangers:
    """What a list has beside the graph.

    Attributes:
        names: the names that are not on the graph.
        exchange: the last read of the list.
    """

    names: tuple[str, ...]
    exchange: Exchange


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def lists_beside_graph(gateway: Gateway) -> tuple[Strangers, ...]:
    """Read each list until the graph has all of its names; names of the suite may stay longer, as it is killed."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    # What the suite had as the robot may be on the gateway's graph for a while after the suite's process was killed.
    own = ("/roaas_", *(f"{name}/" for name in map(end_of, gateway.ros.operations.values()) if name))
    found = []
    for call, body in gateway.of(Lists):
        until = WALL_CLOCK.now() + body.timeout_s + PATIENCE_S
        there: set[str] = set()
        while True:
            exchange = gateway.send(gateway.binding.make(call, None), body.timeout_s + PATIENCE_S)
            there |= gateway.robot.names(body.lists)
            listed = _types_in(exchange, body)
            names = [name for name in strangers(listed, there) if not f"{name}/".startswith(own)]
            if not names or WALL_CLOCK.now() > until:
                break
            WALL_CLOCK.sleep(PACE_S)
        if listed:
            found.append(Strangers(tuple(names), exchange))
    return tuple(found)


def strangers(listed: Iterable[str], there: Container[str]) -> list[str]:
    """Return the listed names, which may lack their first slash, that the graph does not have."""
    full = {f"/{name.lstrip('/')}" for name in listed}
    return sorted(name for name in full if name not in there)


@dataclass(frozen=True)
class Grown:
    """Lists and reads while the graph had many topics more.

    Attributes:
        count: how many.
        lacking: by list of topics: how many of them it came to lack, and the last read.
        left: the same for those that it still had, after they had gone.
        presences: what operations on topics returned meanwhile.
    """

    count: int
    lacking: tuple[tuple[int, Exchange], ...]
    left: tuple[tuple[int, Exchange], ...]
    presences: tuple[Presence, ...]


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def graph_grows(gateway: Gateway, effort: Effort) -> Grown:
    """Put many topics on the graph, read lists and topics, take them off again, and read the lists."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    part, robot = secrets.token_hex(4), gateway.robot
    names = {f"/roaas_{part}/topic_{number}" for number in range(_TOPICS[effort.name])}
    lists = [(call, one) for call, one in gateway.ros.operations.items() if isinstance(one, Lists)]
    lists = [(call, one) for call, one in lists if one.lists == "topics"]
    topics = _Topics(gateway)
    for name in sorted(names):
        robot.publish(name, lists[0][1].of or _KINDS["topics"] if lists else _KINDS["topics"])
    lacking = tuple(_read_until_listed(gateway, call, one, names, there=True) for call, one in lists)
    presences = tuple(topics.publish_all(f"a publisher beside {len(names)} new topics"))
    topics.end()
    for name in sorted(names):
        robot.tell("forget", name=name)
    left = tuple(_read_until_listed(gateway, call, one, names, there=False) for call, one in lists)
    return Grown(len(names), lacking, left, presences)


def _read_until_listed(
    gateway: Gateway, call: str, body: Lists, names: set[str], *, there: bool
) -> tuple[int, Exchange]:
    """Read a list until it has all names, or none; return how many are wrong, and the last read."""
    until = WALL_CLOCK.now() + body.timeout_s + PATIENCE_S
    while True:
        exchange = gateway.send(gateway.binding.make(call, None), body.timeout_s + PATIENCE_S)
        found = names & _types_in(exchange, body).keys()
        wrong = len(names - found) if there else len(found)
        if not wrong or WALL_CLOCK.now() > until:
            return wrong, exchange
        WALL_CLOCK.sleep(PACE_S)


def _put(gateway: Gateway, lists: str, name: str, kind: str) -> None:
    if lists == "topics":
        gateway.robot.publish(name, kind)
    elif lists == "services":
        gateway.robot.tell("serve", service=name, type=kind, script=[{}])
    elif lists == "actions":
        gateway.robot.tell("act", action=name, type=kind, script=[{}])
    else:
        gateway.robot.tell("hold", node=name, values={})


def _read_list(gateway: Gateway, call: str, body: Lists, name: str, kind: str, *, there: bool) -> Listed:
    until = WALL_CLOCK.now() + body.timeout_s
    while True:
        began = WALL_CLOCK.now()
        exchange = gateway.send(gateway.binding.make(call, None), body.timeout_s)
        types = _types_in(exchange, body).get(name)
        is_right = exchange.response.ok and ((types is not None and kind in types) if there else types is None)
        if is_right or began > until:
            return Listed(body, name, kind, there, is_right, " ".join(types or ()), exchange)
        WALL_CLOCK.sleep(PACE_S)


def _types_in(exchange: Exchange, body: Lists) -> dict[str, list[str]]:
    """Return the types of each name that a list has; those of a list without types are any."""
    items = value_at(document_of(exchange.response.body).value, body.at)
    found: dict[str, list[str]] = {}
    for item in items if isinstance(items, list) else []:
        types = value_at(item, body.type) if body.type is not None else [body.of, *_KINDS.values()]
        found[str(value_at(item, body.name))] = [str(one) for one in (types if isinstance(types, list) else [types])]
    return found


@dataclass(frozen=True)
class Growth:
    """How many subscriptions more a topic had after many reads.

    Attributes:
        body: its map.
        count: how many reads, or clients of a stream that came and went.
        more: how many subscriptions more it had after them.
        exchange: the last read.
    """

    body: Reads
    count: int
    more: int
    exchange: Exchange


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def many_reads(gateway: Gateway, effort: Effort) -> tuple[Growth, ...]:
    """Read a topic many times, or have clients of its stream come and go, and count its subscriptions."""
    read, mapped = [], dict(gateway.of(Reads))
    reads = max(_READS["quick"], _READS[effort.name] // len(mapped))
    with ExitStack() as stack:
        for call, body in mapped.items():
            gateway.read(call, body)
            before = gateway.robot.count(body.topic, "subscribers")
            if body.stream and gateway.plays:
                stack.enter_context(gateway.robot.publishing(body.topic))
                exchanges = [_follow(gateway, call, body) for _ in range(_CLIENTS)]
            else:
                exchanges = [gateway.read(call, body) for _ in range(reads)]
            read.append((body, len(exchanges), before, exchanges[-1]))
        # The graph shows a new subscription a moment later.
        WALL_CLOCK.sleep(_LATE_S)
        found, until = [], WALL_CLOCK.now() + PATIENCE_S
        for body, count, before, exchange in read:
            # A subscription that is closed late is closed nevertheless.
            while (after := gateway.robot.count(body.topic, "subscribers")) > before + 1 and WALL_CLOCK.now() < until:
                WALL_CLOCK.sleep(PACE_S)
            found.append(Growth(body, count, after - before, exchange))
    return tuple(found)


def _follow(gateway: Gateway, call: str, body: Reads) -> Exchange:
    """Open a stream, get a message and leave; a server may notice that when it sends the next message."""
    gateway.robot.publish(body.topic, body.type, gateway.usual(body.type), repeat_s=_REPEAT_S)
    with closing(gateway.stream(call, body)) as stream:
        stream.take_new(1, _LATE_S)
        return exchange_of(stream, stream.last)
