"""Rules on deliveries with an Idempotency-Key: one key gives at most one message; two keys give two."""

from collections.abc import Iterator
from http import HTTPStatus

from conformance.packs.table1.scenarios.counted_deliveries import CountedDeliveries, Keyed, counted_deliveries
from conformance.scenarios.rule import NotTested, Outcome, rule
from conformance.verdict.evidence import Case


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
