"""The scenario on streams: publish messages in a row, and record those that arrive over a gateway's streams."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from msgspec.structs import replace

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.gateway import PATIENCE_S, Gateway, exchange_of
from conformance.scenarios.ros.services import NO_PLAY
from conformance.scenarios.ros.web import differences, document_of
from conformance.scenarios.scenario import NotDeclaredError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.ros_map import Reads
from conformance.transport.exchange import Exchange
from conformance.transport.rosbridge import Subscription
from conformance.transport.streams import Message, Stream
from conformance.verdict.effort import Effort

# Messages in a row, and pause after each, s: no more than a subscription with ROS's default depth of 10 keeps
# while its process waits for a processor.
_IN_A_ROW: Final = 8
_GAP_S: Final = 0.02
_ROUNDS: Final = {"quick": 2, "standard": 3, "deep": 8}
# The suite publishes to a throttled stream for _INTERVALS of its intervals, _IN_EACH messages in each.
_INTERVALS, _IN_EACH = 4, 5
# That of a rosbridge, s.
_THROTTLE_S: Final = 0.2
# Messages while a client is away; when it is back, a stream that sends those does so in this time, s.
_AWAY: Final = 3
_RESUMES_S: Final = 1.0
# After the last message, what comes twice comes so soon, s.
_MORE_S: Final = 0.3


@dataclass(frozen=True)
class Streamed:
    """Messages in a row on a topic, and what came of them over one stream.

    Attributes:
        operation: the operation of the map.
        body: its map.
        how: as a noun phrase.
        sent: JSON of each message, in the order of publishing.
        came: for each message of the stream: request and message, and the place in ``sent`` of what it shows; -1: none.
        lasted_s: from the first message that was published, or came, to the last, s.
        opened: request and response of the stream's beginning, or what came last.
        reliable: whether no message is lost on the way to the gateway.
        known: how many of those that were sent the client has had, as it said when it connected.
    """

    operation: str
    body: Reads
    how: str
    sent: tuple[str, ...]
    came: tuple[tuple[Exchange, int], ...]
    lasted_s: float
    opened: Exchange
    reliable: bool
    known: int = 0


@scenario(needs=(Need.REST,), leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def topic_streams(gateway: Gateway, effort: Effort) -> tuple[Streamed, ...]:
    """Publish messages in a row, and hear them over streams: of two clients, and again after each has reconnected."""
    if not gateway.plays:
        raise NotDeclaredError(NO_PLAY)
    found: list[Streamed] = []
    with partial_trace(lambda: tuple(found)):
        for call, body in gateway.of(Reads):
            # A rosbridge throttles whatever it is asked to (3.4.4).
            ways = [body, replace(body, throttle_s=_THROTTLE_S)] if body.stream == "rosbridge" else [body]
            for way in ways if body.stream else []:
                with gateway.robot.publishing(body.topic):
                    for turn in range(1 if way.throttle_s else _ROUNDS[effort.name]):
                        found += _round(gateway, call, way, turn)
                        if any(len(event.came) != len(event.sent) for event in found[-2:]):
                            break
        if not found:
            raise NotDeclaredError("[ros.operations] has no topic with 'stream'")
    return tuple(found)


def _round(gateway: Gateway, call: str, body: Reads, turn: int) -> Iterator[Streamed]:
    """Yield the messages of the streams of two clients, which are opened and closed for this."""
    robot, clock, streams = gateway.robot, WALL_CLOCK, [gateway.stream(call, body) for _ in range(2)]
    try:
        before = gateway.usual(body.type)
        robot.publish(body.topic, body.type, before, repeat_s=0.1)
        for stream in streams:
            stream.take_new(1, body.within_s + PATIENCE_S)
        robot.publish(body.topic, body.type)
        clock.sleep(_MORE_S + body.throttle_s)
        number, gap_s = _IN_A_ROW, _GAP_S
        if body.throttle_s:
            number, gap_s = _INTERVALS * _IN_EACH, body.throttle_s / _IN_EACH
        values = [gateway.usual(body.type) for _ in range(number)]
        began = clock.now()
        published = robot.publish(body.topic, body.type, *values, gap_s=gap_s)
        published_s = clock.now() - began
        for place, stream in enumerate(streams):
            how = f"{number} messages in a row, {('first', 'second')[place]} of two clients"
            how += f" after it has reconnected {turn} times" if turn else ""
            came = _came(gateway, stream, body, values, 1 if body.throttle_s else number, before)
            opened = came[-1][0] if came else exchange_of(stream, Message(began, b""))
            times = [exchange.response.received_s for exchange, _ in came] or [began]
            text, lasted_s = tuple(map(json.dumps, values)), max(published_s, times[-1] - times[0])
            yield Streamed(call, body, how, text, came, lasted_s, opened, published.reliably)
            if stream.last_id and not turn and [one for _, one in came] == list(range(number)):
                # The next ones are published while it is away (HTML Living Standard, 9.2.4).
                stream.close()
                away = [gateway.usual(body.type) for _ in range(_AWAY)]
                robot.publish(body.topic, body.type, *away, gap_s=gap_s)
                clock.sleep(_MORE_S)
                back = streams[place] = gateway.stream(call, body, stream.last_id)
                came = _came(gateway, back, body, [*values, *away], _AWAY, before, _RESUMES_S)
                text, how = (*text, *map(json.dumps, away)), f"after {number} messages, with its Last-Event-ID"
                yield Streamed(call, body, how, text, came, 0.0, opened, published.reliably, number)
        if isinstance(streams[0], Subscription):
            streams[0].unsubscribe()
            clock.sleep(_MORE_S)
            streams[0].take_new()
            robot.publish(body.topic, body.type, *values)
            came = tuple((exchange_of(streams[0], message), -1) for message in streams[0].take_new(1, _MORE_S))
            opened = exchange_of(streams[0], streams[0].last)
            yield Streamed(call, body, "after it was unsubscribed from", (), came, 0.0, opened, reliable=True)
    finally:
        for stream in streams:
            stream.close()


def _came(
    gateway: Gateway, stream: Stream, body: Reads, values: list[Any], number: int, before: Any, within_s: float = 0.0
) -> tuple[tuple[Exchange, int], ...]:
    """Return what came until the number or the last value is there, or none can come, and that of a moment after.

    A busy gateway may still be sending the message from ``before`` those that count.
    """
    definition, known = gateway.definition(body.type), [*values, before]
    found: list[tuple[Exchange, int]] = []

    def take_new(count: int, within_s: float) -> bool:
        messages = stream.take_new(count, within_s)
        for message in messages:
            document = document_of(message.octets)
            alike = (n for n, one in enumerate(known) if not differences(document, one, definition, body, gateway.ros))
            place = next(alike, -1)
            if place != len(values):
                found.append((exchange_of(stream, message), place))
        return bool(messages)

    within_s = within_s or body.within_s + PATIENCE_S
    while len(found) < number and (not found or found[-1][1] < len(values) - 1) and take_new(1, within_s):
        pass
    take_new(number, _MORE_S + body.throttle_s)
    return tuple(found)
