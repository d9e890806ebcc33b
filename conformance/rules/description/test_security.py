"""Operations for which the description requires credentials (OpenAPI 3.1, 4.8.30)."""

from collections.abc import Iterable

from conformance.scenarios.anonymous import anonymous_reads
from conformance.scenarios.rule import Case, Outcome, rule
from conformance.transport.exchange import Exchange


@rule("description/security", on=(anonymous_reads,))
def security(trace: tuple[Exchange, ...]) -> Iterable[Outcome]:
    """Judge whether reads that require credentials are refused without them."""
    for exchange in trace:
        expected = "a refusal, because the description requires credentials"
        yield Case(not exchange.response.ok, exchange, expected, cause=exchange.request.endpoint)
