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
    for one in trace:
        places = [place for _, place in one.came]
        strange = {exchange.response.body for exchange, place in one.came if place < 0}
        cause = f"{one.operation} once"
        missing = [place for place in range(len(one.sent)) if place not in places]
        if one.known:
            # Whether it sends what came meanwhile, and how much of that, is open.
            again = [place for place in places if 0 <= place < one.known]
            expected = f"no message on {one.body.topic} that the client has had ({one.how})"
            yield Case(not again, one.opened, expected, f"message {_list(again)} again", f"{one.operation} again")
            new = [place for place in places if place >= one.known]
            missing = [place for place in missing if new and min(new) < place < max(new)]
        twice = sorted({place for place in places if place >= 0 and places.count(place) > 1})
        expected = f"each message on {one.body.topic} once ({one.how})"
        if not one.sent:
            expected = f"no message on {one.body.topic} {one.how}"
            yield Case(not one.came, one.opened, expected, f"{len(one.came)} messages", f"{one.operation} unsubscribe")
            continue
        if twice:
            yield Case(False, one.opened, expected, f"message {_list(twice)} more than once", cause)
        elif not missing or one.body.throttle_s:
            yield Case(bool(places or one.known), one.opened, expected, "none", cause)
        elif not one.reliable:
            yield NotTested(f"the gateway subscribes to {one.body.topic} with best effort, and may lose messages")
        elif len(strange) < len(missing):  # else they came, and were changed
            yield Case(False, one.opened, expected, f"no message {_list(missing)} of {len(one.sent)}", cause)


@rule("ros-gateway/stream-order", on=(topic_streams,))
def stream_order(trace: tuple[Streamed, ...]) -> Iterator[Outcome]:
    """Judge whether no message comes after a later one."""
    for one in trace:
        newest = -1
        expected = f"the messages on {one.body.topic} in the order in which they were published ({one.how})"
        for exchange, place in one.came:
            if place >= 0:
                found = f"message {place + 1} after message {newest + 1}"
                yield Case(place >= newest, exchange, expected, found, f"{one.operation} order")
                newest = max(newest, place)


@rule("ros-gateway/stream-throttle", on=(topic_streams,))
def stream_throttle(trace: tuple[Streamed, ...]) -> Iterator[Outcome]:
    """Judge whether a throttled stream sends no more messages than its interval allows; one more is let pass."""
    if not any(one.body.throttle_s for one in trace):
        yield NotClaimed("no stream of the map has `throttle_s`")
    for one in trace:
        if (throttle_s := one.body.throttle_s) and one.sent:
            most, number = int(one.lasted_s / throttle_s) + 2, len(one.came)
            expected = f"{most} messages at most in {one.lasted_s:.1f} s, as throttle_s is {throttle_s:g} s"
            yield Case(number <= most, one.opened, expected, f"{number}", one.operation)
