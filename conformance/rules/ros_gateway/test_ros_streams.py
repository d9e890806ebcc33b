"""Whether a stream of a gateway has each message of its topic, once, in order, and as rarely as declared."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.scenarios.ros.topic_streams import Streamed, topic_streams
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.verdict.evidence import Case


def _list(places: list[int]) -> str:
    return ", ".join(str(place + 1) for place in places)


@rule("ros-gateway/stream-once", on=(topic_streams,))
def stream_once(trace: tuple[Streamed, ...]) -> Iterator[Outcome]:
    """Judge whether each message comes exactly once; a throttled stream leaves some out, and has none twice."""
    for event in trace:
        places = [place for _, place in event.came]
        strange = {exchange.response.body for exchange, place in event.came if place < 0}
        cause = f"{event.operation} once"
        missing = [place for place in range(len(event.sent)) if place not in places]
        if event.known:
            # The gateway may send all, some or none of the messages of that time.
            again = [place for place in places if 0 <= place < event.known]
            expected = f"no message on {event.body.topic} that the client has had ({event.how})"
            yield Case(not again, event.opened, expected, f"message {_list(again)} again", f"{event.operation} again")
            new = [place for place in places if place >= event.known]
            missing = [place for place in missing if new and min(new) < place < max(new)]
        twice = sorted({place for place in places if place >= 0 and places.count(place) > 1})
        expected = f"each message on {event.body.topic} once ({event.how})"
        if not event.sent:
            expected = f"no message on {event.body.topic} {event.how}"
            cause = f"{event.operation} unsubscribe"
            yield Case(not event.came, event.opened, expected, f"{len(event.came)} messages", cause)
            continue
        if twice:
            yield Case(False, event.opened, expected, f"message {_list(twice)} more than once", cause)
        elif not missing or event.body.throttle_s:
            yield Case(bool(places or event.known), event.opened, expected, "none", cause)
        elif not event.reliable:
            yield NotTested(f"the gateway subscribes to {event.body.topic} with best effort, and may lose messages")
        elif len(strange) < len(missing):  # else they came, and were changed
            yield Case(False, event.opened, expected, f"no message {_list(missing)} of {len(event.sent)}", cause)


@rule("ros-gateway/stream-order", on=(topic_streams,))
def stream_order(trace: tuple[Streamed, ...]) -> Iterator[Outcome]:
    """Judge whether no message comes after a later one."""
    for event in trace:
        newest = -1
        expected = f"the messages on {event.body.topic} in the order in which they were published ({event.how})"
        for exchange, place in event.came:
            if place >= 0:
                found = f"message {place + 1} after message {newest + 1}"
                yield Case(place >= newest, exchange, expected, found, f"{event.operation} order")
                newest = max(newest, place)


@rule("ros-gateway/stream-throttle", on=(topic_streams,))
def stream_throttle(trace: tuple[Streamed, ...]) -> Iterator[Outcome]:
    """Judge whether a throttled stream sends no more messages than its interval allows; one more is let pass."""
    if not any(event.body.throttle_s for event in trace):
        yield NotClaimed("no stream of the map has `throttle_s`")
    for event in trace:
        if (throttle_s := event.body.throttle_s) and event.sent:
            most, number = int(event.lasted_s / throttle_s) + 2, len(event.came)
            expected = f"{most} messages at most in {event.lasted_s:.1f} s, as throttle_s is {throttle_s:g} s"
            yield Case(number <= most, event.opened, expected, f"{number}", event.operation)
