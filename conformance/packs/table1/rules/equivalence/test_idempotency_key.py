"""Rules on deliveries with an Idempotency-Key: one key may give one message; two keys give two."""

from collections.abc import Iterator
from http import HTTPStatus

from conformance.packs.table1.scenarios.keyed_deliveries import KeyedDeliveries, keyed_deliveries
from conformance.scenarios.rule import Case, NotTested, Outcome, rule


@rule("equivalence/idempotency-key", on=(keyed_deliveries,))
def one_key(trace: KeyedDeliveries) -> Iterator[Outcome]:
    """Judge that two requests with one key make one message and have the same status."""
    if reason := _rejected(trace):
        yield reason
        return
    first, second = (exchange.response.status for exchange in trace.twice)
    yield Case(
        trace.twice_arrived == 1 and first == second < HTTPStatus.MULTIPLE_CHOICES,
        trace.twice[1],
        "one message, and the same status twice, for two requests with one Idempotency-Key",
        f"{trace.twice_arrived} messages, statuses {first} and {second}",
        "not taken",
    )


@rule("equivalence/idempotency-other-key", on=(keyed_deliveries,))
def two_keys(trace: KeyedDeliveries) -> Iterator[Outcome]:
    """Judge that two requests with two keys make two messages."""
    if reason := _rejected(trace):
        yield reason
        return
    yield Case(
        trace.apart_arrived == trace.accepted_apart,
        trace.apart[1],
        "a message for each of two accepted requests with different Idempotency-Keys",
        f"{trace.apart_arrived} messages for {trace.accepted_apart} accepted requests",
        "lost",
    )


def _rejected(trace: KeyedDeliveries) -> NotTested | None:
    """Return why there is nothing to judge, if the robot rejects deliveries with a key."""
    if trace.accepted_apart and trace.twice[0].response.ok:
        return None
    return NotTested(f"the robot rejects deliveries with an Idempotency-Key: {trace.apart[0].came}")
