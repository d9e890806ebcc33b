"""Rules on deliveries: each accepted request becomes one identical ROS message, and so does each Idempotency-Key."""

from collections.abc import Iterator
from http import HTTPStatus
from itertools import chain
from typing import Final

from conformance.packs.table1.robot.delivery import Batch, Deliveries, Delivery, Sent
from conformance.packs.table1.scenarios.deliveries import (
    CountedDeliveries,
    Keyed,
    counted_deliveries,
    deliveries,
    deliveries_last,
    deliveries_later,
)
from conformance.rules.ros_gateway.arrivals import Request, come_though_refused, counts, in_order
from conformance.scenarios.rule import NotTested, Outcome, Rule, rule
from conformance.verdict.evidence import Case

# For a delivery that was sent twice and must give two messages: the interfaces.
_TWO: Final = {"same": ["rest", "soap"], "twice": ["rest", "rest"]}
# How a delivery was sent that has one place in the order.
_ALONE: Final = ("rest", "soap", "coffee")
# Batches with messages that the suite did not cause, before they count as a failure: the robot may have other clients.
_OFTEN: Final = 2


def _arriving(requirement: str, how: str, says: str) -> Rule:
    """Return the rule that each delivery that was sent in one way arrives once."""

    def judge(trace: Deliveries) -> Iterator[Outcome]:
        return _arrives_once(trace, how)

    judge.__doc__ = f"Judge that {says}."
    return rule(f"equivalence/{requirement}", on=(deliveries, deliveries_later, deliveries_last))(judge)


delivery_rest = _arriving("delivery-rest", "rest", "a delivery accepted over REST arrives once, with identical values")
delivery_soap = _arriving("delivery-soap", "soap", "a delivery accepted over SOAP arrives once, with identical values")
coffee_soap = _arriving(
    "coffee-soap", "coffee", "a coffee request accepted over SOAP arrives once, with identical values and code 4"
)
delivery_same = _arriving(
    "delivery-same", "same", "the same delivery over REST and over SOAP makes two identical messages"
)
delivery_repeated = _arriving("delivery-repeated", "twice", "a repeated PUT makes another message")
delivery_concurrent = _arriving(
    "delivery-concurrent", "together", "each of several deliveries accepted at once arrives once, with identical values"
)


@rule("equivalence/delivery-order", on=(deliveries,))
def delivery_order(trace: Deliveries) -> Iterator[Outcome]:
    """Judge that deliveries over one interface arrive in order; each interface may have its own ROS publisher."""
    for batch, _ in trace.batches_to_judge():
        for interface in ("rest", "soap"):
            # A delivery with two messages has no single place in the order, nor has one that was sent at the same time
            # as others.
            ordered = [one for one in _requests(trace, batch) if one.client == interface and one.sent.how in _ALONE]
            for one, holds in in_order([one for one in ordered if one.accepted], _keys(trace, batch)):
                expected = f"deliveries over {interface} in the order in which they were sent"
                yield Case(holds, one.sent.exchange, expected, "another order")


@rule("equivalence/delivery-only", on=(deliveries, deliveries_later))
def delivery_only(trace: Deliveries) -> Iterator[Outcome]:
    """Judge that no message arrives besides one for each accepted request."""
    for batch, before in trace.batches_to_judge():
        exchange = next((message.exchange for message in _accepted_in(batch)), None)
        found, cause = "", ""
        again, unwanted, unsent = _others(trace, batch, before)
        if again:
            one, exchange = again[0], again[0].exchange
            found, cause = f"an earlier message once more: {one.delivery}", "later"
        elif unwanted:
            one, exchange = unwanted[0], unwanted[0].exchange
            found, cause = f"the message of a request that was not accepted: {one.delivery}", "not accepted"
        elif unsent and sum(bool(_others(trace, *earlier)[2]) for earlier in _all(trace, batch)) >= _OFTEN:
            exchange, found, cause = None, f"a message that no client of the suite sent: {unsent[0]}", "not sent"
        yield Case(not found, exchange, "no message beside the one for each accepted request", found, cause)


def _arrives_once(trace: Deliveries, how: str) -> Iterator[Case]:
    """Yield a case for each accepted delivery that was sent in this way, and for each of its messages that is late."""
    for batch, before in trace.batches_to_judge():
        requests = _requests(trace, batch)
        wanted = {one.key for one in requests if one.accepted}
        others = [sighting.delivery for sighting in batch.seen if trace.key(sighting.delivery) not in wanted]
        for one, came, least, most in counts(requests, _keys(trace, batch)):
            if one.accepted and one.sent.how == how:
                problem = _problem(came, least, most, others) or _wrong_interfaces(trace, batch, one.sent)
                yield _once(one.sent, problem, problem.partition(",")[0])
        for message in _others(trace, batch, before)[0]:
            if message.how == how:
                yield _once(message, "one more message, later", "later")


def _once(one: Sent, problem: str, cause: str) -> Case:
    expected = f"exactly one message for each accepted request, {one.delivery}"
    return Case(not problem, one.exchange, expected, problem, f"{one.interface} {cause}")


def _problem(came: int, least: int, most: int, others: list[Delivery]) -> str:
    """Return how the messages of a delivery differ from those that are due, or an empty text."""
    if least <= came <= most:
        return ""
    return f"{came} messages instead of {least}" if came or not others else f"another message, {others[0]}"


def _wrong_interfaces(trace: Deliveries, batch: Batch, one: Sent) -> str:
    """Return by which interfaces a delivery arrived, where that is seen and wrong, or an empty text."""
    key = trace.key(one.delivery)
    interfaces = sorted(seen.interface for seen in batch.seen if trace.key(seen.delivery) == key)
    due = _TWO.get(one.how, [one.interface])[: len(interfaces)]
    return f"{len(interfaces)} by {' and '.join(interfaces)}" if any(interfaces) and interfaces != due else ""


def _others(
    trace: Deliveries, batch: Batch, before: tuple[Batch, ...]
) -> tuple[list[Sent], list[Sent], list[Delivery]]:
    """Return the arrived deliveries that the batch did not order.

    Returns:
        The deliveries of earlier batches that arrived again, those that were not accepted, and those never sent.
    """
    known = {trace.key(message.delivery) for message in _accepted_in(batch)}
    sent = list(chain.from_iterable(one.sent for one in (*before, batch)))
    known |= {trace.key(message.delivery) for message in sent if message.may_arrive}
    earlier = {trace.key(message.delivery): message for message in chain.from_iterable(map(_accepted_in, before))}
    not_accepted = come_though_refused(_requests(trace, *before, batch), _keys(trace, batch))
    unwanted = {one.key: one.sent for one, came in not_accepted if came and one.key not in known}
    others = [sighting.delivery for sighting in batch.seen if trace.key(sighting.delivery) not in known]
    keys = [trace.key(delivery) for delivery in others]
    return (
        [earlier[key] for key in keys if key in earlier],
        list(unwanted.values()),
        [delivery for delivery, key in zip(others, keys, strict=True) if key not in earlier and key not in unwanted],
    )


def _all(trace: Deliveries, last: Batch) -> Iterator[tuple[Batch, tuple[Batch, ...]]]:
    """Yield each batch of the trace up to ``last``, with the batches before it."""
    for index, batch in enumerate(trace.batches):
        yield batch, trace.batches[:index]
        if batch is last:
            return


def _accepted_in(batch: Batch) -> list[Sent]:
    return [message for message in batch.sent if message.is_ok]


def _requests(trace: Deliveries, *batches: Batch) -> list[Request[Sent]]:
    """Return the deliveries of batches as requests for one message each; those over one interface have an order."""
    return [
        Request(one, trace.key(one.delivery), one.is_ok or (None if one.may_arrive else False), one.interface)
        for batch in batches
        for one in batch.sent
    ]


def _keys(trace: Deliveries, batch: Batch) -> list[bytes]:
    return [trace.key(sighting.delivery) for sighting in batch.seen]


@rule("equivalence/idempotency-key", on=(counted_deliveries,))
def one_key(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that two requests with one key cause one message and have the same status."""
    keyed = _keyed_of(trace)
    if isinstance(keyed, NotTested):
        yield keyed
        return
    first, second = (exchange.response.status for exchange in keyed.twice)
    yield Case(
        trace.twice_arrived == 1 and first == second < HTTPStatus.MULTIPLE_CHOICES,
        keyed.twice[1],
        "one message, and the same status twice, for two requests with one Idempotency-Key",
        f"{trace.twice_arrived} messages, statuses {first} and {second}",
        "not taken",
    )


@rule("equivalence/idempotency-other-key", on=(counted_deliveries,))
def two_keys(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that two requests with two keys make two messages."""
    keyed = _keyed_of(trace)
    if isinstance(keyed, NotTested):
        yield keyed
        return
    yield Case(
        trace.apart_arrived == keyed.accepted_apart,
        keyed.apart[1],
        "a message for each of two accepted requests with different Idempotency-Keys",
        f"{trace.apart_arrived} messages for {keyed.accepted_apart} accepted requests",
        "lost",
    )


def _keyed_of(trace: CountedDeliveries) -> Keyed | NotTested:
    """Return the deliveries with a key, or why there is nothing to judge."""
    if trace.keyed is None:
        return NotTested(trace.unseen)
    if trace.keyed.accepted_apart and trace.keyed.twice[0].response.ok:
        return trace.keyed
    return NotTested(f"the robot rejects deliveries with an Idempotency-Key: {trace.keyed.apart[0].came}")
