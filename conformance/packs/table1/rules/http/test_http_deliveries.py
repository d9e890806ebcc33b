"""Rule on several deliveries at the same moment: each response must belong to its request."""

from collections.abc import Iterator

from conformance.packs.table1.scenarios.concurrent_puts import concurrent_deliveries
from conformance.scenarios.rule import Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case


@rule("http/concurrent-answers", on=(concurrent_deliveries,))
def concurrent_answers(trace: tuple[tuple[bool, Exchange], ...]) -> Iterator[Outcome]:
    """Judge that the robot accepts the valid deliveries and rejects the others."""
    for valid, exchange in trace:
        expected = f"{'2xx' if valid else '4xx'} for this delivery, while others are answered"
        yield Case(exchange.response.ok == valid, exchange, expected, cause="another's answer")
