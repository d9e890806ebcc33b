"""Operations for which the description requires credentials (OpenAPI 3.1, 4.8.30)."""

from collections.abc import Iterable

from conformance.scenarios.anonymous import anonymous_requests
from conformance.scenarios.rule import Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.case import Case


@rule("description/security", on=(anonymous_requests,))
def security(trace: tuple[Exchange, ...]) -> Iterable[Outcome]:
    """Judge whether what requires credentials is refused without them, and with wrong ones."""
    for exchange in trace:
        expected = "a refusal, because the description requires credentials"
        yield Case(not exchange.response.ok, exchange, expected, cause="served")
