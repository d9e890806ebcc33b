"""Scenarios on topics: the messages that a gateway returns from topics, and publishes on them.

Times are s of the monotonic clock, which all processes of a machine share.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import msgspec

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import Definition
from conformance.scenarios.ros.gateway import CROWD, PACE_S, PATIENCE_S, Gateway
from conformance.scenarios.ros.retries import Retry, retries
from conformance.scenarios.ros.robot import Heard
from conformance.scenarios.ros.samples import Kind, Sample
from conformance.scenarios.ros.web import (
    content_of,
    differences,
    differing,
    document_of,
    equal,
    fields_in,
    is_finite,
    is_out_of_range,
    is_success,
    with_texts,
)
from conformance.scenarios.scenario import NoOccasionError, NotPossibleError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.ros_map import Publishes, Reads
from conformance.transport.exchange import Exchange, Outgoing
from conformance.transport.parallel import MOST_CLIENTS, crowd
from conformance.verdict.effort import Effort

_NEEDS: Final = (Need.REST,)
# A message is published again so often, for gateways that subscribe when they are asked, or wait for the next one, s.
_REPEAT_S: Final = 0.1
_REPEAT_LARGE_S: Final = 1.0
# Wait for a large message that may be lost, s.
_LARGE_S: Final = 2.5
# Reads in a row that show the same wrong message: it is not on its way any more.
_SURE: Final = 4
_SURE_S: Final = 0.4
# Lost messages after which an operation is given up.
_GIVES_UP: Final = 2
# Time in which surplus messages arrive, s.
_MORE_S: Final = 0.5
# A watchdog's messages have ended after this silence, s. A topic that has none is given up after _SILENT_S, s.
_SILENCE_S: Final = 2.0
_SILENT_S: Final = 10.0
# A publisher may keep no more messages than that, and need not wait for who is slow.
_BURST: Final = 8
# Messages of each of many clients.
_OF_EACH: Final = 3
_TEXTS: Final = "a message with a text in place of each number"
_SAMPLES: Final = {"quick": 8, "standard": 16, "deep": 40}
_LARGE: Final = {"quick": 2_000, "standard": 10_000, "deep": 10_000}


@dataclass(frozen=True)
class Shown:
    """A message on a topic, and an operation's response to it.

    Attributes:
        operation: the operation.
        topic: its topic.
        what: the message as a noun phrase.
        kind: what it is for.
        value: JSON of the message, with all its fields.
        published: when it was published first.
        exchange: the read that shows it, else the last one.
        sent: when that was requested.
        was_shown: whether it shows the message.
        reliably: whether the gateway subscribes so that no message is lost on the way.
        earlier: reads of other content before that.
        later: reads after that, before the next message.
    """

    operation: str
    topic: str
    what: str
    kind: Kind
    value: str
    published: float
    exchange: Exchange
    sent: float
    was_shown: bool
    reliably: bool = True
    earlier: int = 0
    later: tuple[Exchange, ...] = ()


@dataclass(frozen=True)
class Topics:
    """Reads of topics, and the definitions of their types."""

    probes: tuple[Shown, ...]
    definitions: dict[str, Definition]


@scenario(needs=_NEEDS, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def topic_reads(gateway: Gateway, effort: Effort) -> Topics:
    """Publish messages of extreme values on topics, and read them through the gateway."""
    if not gateway.plays:
        raise NoOccasionError("the suite is not the robot, whose messages it would know: --ros-play")
    shown: list[Shown] = []
    definitions: dict[str, Definition] = {}
    with partial_trace(lambda: Topics(tuple(shown), definitions)):
        for call, reads in gateway.of(Reads):
            definitions[call] = gateway.definition(reads.type)
            older = [json.loads(one.value) for one in shown if one.topic == reads.topic]
            with gateway.robot.publishing(reads.topic):
                shown.extend(_Reader(gateway, call, reads, definitions[call], older).publish_samples(effort))
    # Messages of another robot say nothing about the gateway.
    gateway.check_alone()
    return Topics(tuple(shown), definitions)


@dataclass
class _Reader:
    gateway: Gateway
    call: str
    reads: Reads
    definition: Definition
    older: list[dict[str, Any]]
    contents: set[str] = field(default_factory=set)

    def publish_samples(self, effort: Effort) -> Iterator[Shown]:
        """Publish messages, and yield the gateway's response for each."""
        lost = 0
        # An operation on a topic that another one has read is sent fewer.
        most = _SAMPLES["quick" if self.older else effort.name]
        for sample in self.gateway.maker(self.definition).samples(most, large=_LARGE[effort.name]):
            if sample.kind is Kind.NON_FINITE and is_finite(fields_in(sample.value, self.reads)):
                # The operation does not show that field.
                continue
            shown = self.of(sample)
            yield shown
            waited_s = 0.0 if shown.was_shown else shown.sent - shown.published
            lost += sample.kind is not Kind.LARGE and waited_s > self.reads.within_s
            if lost >= _GIVES_UP:
                return
            self.contents.add(content_of(shown.exchange, self.reads))

    def of(self, sample: Sample) -> Shown:
        """Publish a message, and read until it is shown, or surely another one, or its time is over."""
        clock, reads = WALL_CLOCK, self.reads
        repeat_s = _REPEAT_LARGE_S if sample.kind is Kind.LARGE else _REPEAT_S
        value = self.gateway.complete(reads.type, sample.value)
        published = self.gateway.robot.publish(reads.topic, reads.type, sample.value, repeat_s=repeat_s)
        reliably = published.reliably or sample.kind is not Kind.LARGE
        until = published.at + (max(reads.max_age_s or 0.0, reads.within_s) if reliably else _LARGE_S)
        patience_s = 0.0 if sample.kind is Kind.NON_FINITE else PATIENCE_S
        wrong: list[tuple[float, str]] = []
        earlier = 0
        while True:
            sent = clock.now()
            exchange = self.gateway.read(self.call, self.reads)
            is_shown = self.shows(exchange, value, sample.kind)
            is_stale = self.is_stale(exchange)
            if is_shown or sent > until + is_stale * patience_s:
                break
            if is_stale:
                wrong, earlier = [], earlier + 1
            else:
                here = content_of(exchange, self.reads)
                wrong = [*(pair for pair in wrong if pair[1] == here), (sent, here)]
                if len(wrong) >= _SURE and sent - wrong[0][0] > _SURE_S:
                    break
            clock.sleep(PACE_S)
        later = tuple(self.gateway.read(self.call, self.reads) for _ in range(2)) if is_shown else ()
        text = json.dumps(value)
        return Shown(
            self.call, reads.topic, sample.what, sample.kind, text, published.at, exchange, sent, is_shown,
            reliably, earlier, later,
        )  # fmt: skip

    def shows(self, exchange: Exchange, value: dict[str, Any], kind: Kind) -> bool:
        """Return whether a response shows a message."""
        if kind is Kind.NON_FINITE and self.gateway.ros.non_finite == "refused":
            return not is_success(exchange, self.reads)
        document = document_of(exchange.response.body)
        found = differences(document, value, self.definition, self.reads, self.gateway.ros)
        return is_success(exchange, self.reads) and not found

    def is_stale(self, exchange: Exchange) -> bool:
        """Return whether a response shows no message, or one that was shown before."""
        if not is_success(exchange, self.reads) or content_of(exchange, self.reads) in {"None", *self.contents}:
            return True
        # Another operation showed it.
        document = document_of(exchange.response.body)
        found = (differing(document, value, self.definition, self.reads, self.gateway.ros) for value in self.older)
        return any(next(fields, None) is None for fields in found)


@dataclass(frozen=True)
class Sent:
    """A message that an operation was sent.

    Attributes:
        operation: the operation.
        topic: on which it publishes.
        what: the message as a noun phrase.
        value: JSON of the message; empty if it is none.
        exchange: request and response.
        accepted: whether it was answered 2xx, and not by what the map says is a failure.
        client: who sent it.
        is_wrong: whether it has values that the message cannot have.
    """

    operation: str
    topic: str
    what: str
    value: str
    exchange: Exchange
    accepted: bool
    client: int = 0
    is_wrong: bool = False


@dataclass(frozen=True)
class Burst:
    """Messages that an operation was sent in a row or at once, and all messages that arrived.

    Attributes:
        operation: the operation.
        how: as a noun phrase.
        sent: in the order of sending.
        heard: in the order of arrival.
        reliable: whether the gateway publishes reliably, and so few that no message is lost on the way.
        more: publishers on the topic beyond those before the first burst.
    """

    operation: str
    how: str
    sent: tuple[Sent, ...]
    heard: tuple[Heard, ...]
    reliable: bool = True
    more: int = 0


@scenario(needs=_NEEDS, leaves=Leaves.AT_REST, stage=Stage.ACTING)
def topic_writes(gateway: Gateway, effort: Effort) -> tuple[Burst, ...]:
    """Send messages with extreme values to the gateway one by one, and receive what it publishes."""
    return tuple(_bursts(gateway, lambda writer: writer.one_by_one(effort)))


@scenario(needs=_NEEDS, leaves=Leaves.AT_REST, stage=Stage.ACTING)
def topic_bursts(gateway: Gateway, effort: Effort) -> tuple[Burst, ...]:
    """Send messages in a row from one client, and at once from several, and receive what the gateway publishes."""
    times = {"quick": 1, "standard": 3}.get(effort.name, 8)
    many = gateway.plays and effort.name != "quick"
    return tuple(_bursts(gateway, lambda writer: writer.in_bursts(times, many=many)))


@scenario(needs=_NEEDS, leaves=Leaves.AT_REST, stage=Stage.ACTING)
def topic_refusals(gateway: Gateway) -> tuple[Burst, ...]:
    """Send messages that are none to the gateway, and hear whether it publishes anything."""
    return tuple(_bursts(gateway, lambda writer: writer.send_malformed()))


@scenario(needs=_NEEDS, leaves=Leaves.AT_REST, stage=Stage.ACTING)
def topic_retries(gateway: Gateway) -> tuple[Retry, ...]:
    """Send equal messages and retries to the gateway, and count what it publishes."""
    return tuple(_bursts(gateway, lambda writer: retries(gateway, writer.call, writer.body, reliable=writer.reliable)))


def _bursts(gateway: Gateway, of: Any) -> Iterator[Any]:
    gateway.need_permission()
    for call, publishes in gateway.of(Publishes):
        writer = _Writer(gateway, call, publishes)
        with gateway.robot.publishing(publishes.publishes):
            writer.begin()
            yield from of(writer)
            writer.end()


@dataclass
class _Writer:
    gateway: Gateway
    call: str
    body: Publishes
    reliable: bool = True

    def __post_init__(self) -> None:
        self.definition = self.gateway.definition(self.body.type)
        self.maker = self.gateway.maker(self.definition)

    def begin(self) -> None:
        """Listen, and have the gateway publish until something comes: its publisher may begin with its first message.

        Raises:
            NotPossibleError: nothing comes.
        """
        robot, topic, clock = self.gateway.robot, self.body.publishes, WALL_CLOCK
        until = clock.now() + 2 * self.body.within_s
        while True:
            self.reliable = not robot.tell("listen", topic=topic, type=self.body.type)["best_effort"]
            one = self.send(self.maker.usual())
            if robot.take_heard(topic, 1, 1.0):
                # Earlier messages may arrive late.
                clock.sleep(_MORE_S)
                robot.take_heard(topic)
                return
            if clock.now() > until:
                came = one.exchange.came
                raise NotPossibleError(f"{self.call} got {came}, and no message came on {topic} ({self.body.type})")
            self.maker.is_gentle |= is_out_of_range(one.exchange, self.body)
            # A publisher that is there by now may be one of best effort, which a reliable subscriber does not hear.
            robot.tell("forget", name=topic)

    def end(self) -> None:
        """Leave a real robot with the message of default values, which stops one that is driven."""
        if not self.gateway.plays:
            self.send(Sample("the message with its defaults", Kind.DEFAULT, {}))

    def request(self, sample: Sample) -> Outgoing:
        """Return the request for a message, with all its fields."""
        return self.gateway.request(self.call, self.body, self.value(sample))

    def value(self, sample: Sample) -> dict[str, Any]:
        """Return the message as a whole."""
        return self.gateway.complete(self.body.type, sample.value)

    def send(self, sample: Sample) -> Sent:
        """Send a message."""
        return self.send_made(sample.what, json.dumps(self.value(sample)), self.request(sample))

    def send_made(self, what: str, value: str, made: Outgoing) -> Sent:
        """Send a request."""
        return self.sent_as(what, value, self.gateway.send(made, self.body.response_s))

    def sent_as(self, what: str, value: str, exchange: Exchange, client: int = 0) -> Sent:
        """Return a sent request with its outcome."""
        accepted = is_success(exchange, self.body)
        return Sent(self.call, self.body.publishes, what, value, exchange, accepted, client)

    def hear(self, count: int, more_s: float) -> tuple[Heard, ...]:
        """Return the messages of this many accepted requests, and those of a moment after."""
        robot, topic = self.gateway.robot, self.body.publishes
        heard = robot.take_heard(topic, count, self.body.within_s)
        while len(heard) < count and (more := robot.take_heard(topic, 1, self.body.within_s)):
            heard += more
        return (*heard, *robot.take_heard(topic, 1, more_s))

    def one_by_one(self, effort: Effort) -> Iterator[Burst]:
        """Yield each message with its outcome."""
        extreme = self.maker.samples(_SAMPLES[effort.name], large=_LARGE[effort.name])
        for sample in extreme if self.gateway.plays else (self.maker.usual() for _ in range(_BURST)):
            if sample.kind is Kind.NON_FINITE and self.gateway.ros.non_finite != "string":
                # JSON has no such number, and null may be refused as well.
                continue
            one = self.send(sample)
            yield Burst(self.call, sample.what, (one,), tuple(self.hear_of(one)), self.reliable)
        yield self.late()

    def late(self) -> Burst:
        """Return the messages that come later, each of a request before."""
        late = self.gateway.robot.take_heard(self.body.publishes, 1, 2 * _MORE_S)
        return Burst(self.call, "nothing more", (), tuple(late), self.reliable)

    def hear_of(self, one: Sent) -> Iterator[Heard]:
        """Yield the messages until that of a request, or until it surely comes no more."""
        if not one.accepted:
            return
        wanted, clock = fields_in(json.loads(one.value), self.body), WALL_CLOCK
        until = clock.now() + self.body.within_s
        while (left_s := until - clock.now()) > 0:
            came = self.gateway.robot.take_heard(self.body.publishes, 1, left_s)
            yield from came
            if any(equal(fields_in(each.content, self.body), wanted) for each in came):
                return
            if came:
                until = min(until, clock.now() + _MORE_S)

    def in_bursts(self, times: int, *, many: bool) -> Iterator[Burst]:
        """Yield bursts of messages: one after the other by one client, and at once by several and by many clients."""
        robot, ends = self.gateway.robot, (self.body.publishes, "publishers")
        before = robot.count(*ends)
        for _ in range(times):
            # Later messages count in the next burst.
            yield self.burst(1, _BURST, f"{_BURST} messages in a row", more_s=0.0)
            crowded = self.burst(MOST_CLIENTS, 1, f"messages of {MOST_CLIENTS} clients at once")
            # A publisher that leaves late leaves all the same.
            until = WALL_CLOCK.now() + self.body.within_s
            while (more := robot.count(*ends) - before) > 1 and WALL_CLOCK.now() < until:
                WALL_CLOCK.sleep(PACE_S)
            yield replace(crowded, more=more)
        if many:
            # A publisher with ROS's usual depth of 10 may lose some of these messages.
            yield replace(self.burst(CROWD, _OF_EACH, f"messages of {CROWD} clients at once"), reliable=False)

    def burst(self, clients: int, each: int, how: str, more_s: float = _MORE_S) -> Burst:
        """Return the outcome of messages of clients that send at the same moment, each one after another."""
        samples = [[self.maker.usual() for _ in range(each)] for _ in range(clients)]
        made = [[(sample, json.dumps(self.value(sample)), self.request(sample)) for sample in own] for own in samples]
        requests = [[request for _, _, request in own] for own in made]
        sent = tuple(
            self.sent_as(one.what, value, attempt, client)
            for client, attempts in enumerate(crowd(self.gateway.api.client, requests, self.body.response_s))
            for attempt, (one, value, _) in zip(attempts, made[client], strict=True)
            if isinstance(attempt, Exchange)
        )
        heard = self.hear(sum(message.accepted for message in sent), more_s)
        return Burst(self.call, how, sent, heard, self.reliable)

    def send_malformed(self) -> Iterator[Burst]:
        """Yield requests that a gateway is likely to refuse, with their outcome."""
        if self.body.in_url and not self.body.fields:
            texts = {f"a text as {name}": self.with_text(name) for name in self.body.in_url}
            numbers = {what for what, name in zip(texts, self.body.in_url, strict=True) if self.is_number(name)}
            yield from self.send_invalid(texts, numbers)
            yield self.late()
            return
        right = self.request(self.maker.usual())
        wrong = {"no body": b""}
        is_wrong = {"half of the body": right.body[: len(right.body) // 2]}
        # Of a map with `fields`, the body may lack what is wrong.
        is_whole = not self.body.places
        if is_whole and self.gateway.plays and (beyond := self.maker.beyond()) is not None:
            is_wrong[beyond.what] = self.gateway.request(self.call, self.body, beyond.value).body
        if self.gateway.binding.syntax == "JSON":
            wrong |= {"a list in place of the message": b"[]", "null": b"null", "a text": b'"x"'}
            # A gateway may make a text of anything; a number of a text it may not.
            (is_wrong if is_whole and self.maker.has_numbers else wrong)[_TEXTS] = with_texts(right.body, self.body)
        every = {what: replace(right, body=body) for what, body in (wrong | is_wrong).items()}
        yield from self.send_invalid(every, is_wrong)
        # A gateway refuses in several places, and each may change what becomes of the next message.
        for what, made in every.items():
            self.send_made(what, "", made)
            one = self.send(self.maker.usual())
            heard = tuple(self.hear_of(one))
            yield Burst(self.call, f"a message after {what}", (one,), heard, self.reliable)
            if not heard:
                break
        yield self.late()

    def with_text(self, name: str) -> Outgoing:
        """Return a request with a text as one of its parameters in the path or query."""
        body = msgspec.structs.replace(self.body, values={**self.body.values, name: "x"})
        return self.gateway.request(self.call, body, self.value(self.maker.usual()))

    def is_number(self, name: str) -> bool:
        """Return whether the field that a parameter gives is a number or a boolean."""
        shape = self.definition.at(self.body.in_url[name])
        return shape is not None and not shape.is_text

    def send_invalid(self, every: Mapping[str, Outgoing], is_wrong: Collection[str]) -> Iterator[Burst]:
        """Send invalid requests and yield their outcome. Repeat them one by one only if any message arrived."""
        for _ in range(2):
            sent = [replace(self.send_made(what, "", made), is_wrong=what in is_wrong) for what, made in every.items()]
            if not self.gateway.robot.take_heard(self.body.publishes, 1, _MORE_S):
                yield from (Burst(self.call, one.what, (one,), (), self.reliable) for one in sent)
                return
            # The message may come from a watchdog of the gateway, not from these requests.
            if not self.is_silent():
                return
        for what, made in every.items():
            yield from self.malformed_as(what, made, is_wrong=what in is_wrong)

    def malformed_as(self, what: str, made: Outgoing, *, is_wrong: bool) -> Iterator[Burst]:
        """Yield an invalid request with its outcome, apart from messages that the gateway publishes by itself."""
        for _ in range(2):
            one = replace(self.send_made(what, "", made), is_wrong=is_wrong)
            heard = self.gateway.robot.take_heard(self.body.publishes, 1, _MORE_S)
            if not heard:
                break
            # It may be the gateway's own word, as of a watchdog: then the request is sent again in silence.
            if not self.is_silent():
                return
        yield Burst(self.call, what, (one,), tuple(heard), self.reliable)

    def is_silent(self) -> bool:
        """Wait until nothing comes for a while; return whether that is so."""
        until = WALL_CLOCK.now() + _SILENT_S
        while WALL_CLOCK.now() < until:
            if not self.gateway.robot.take_heard(self.body.publishes, 1, _SILENCE_S):
                return True
        return False
