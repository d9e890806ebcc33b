"""Judge one exchange by the rules that compare single responses with a device's description."""

from typing import Final

from conformance.api.rest.variations import Kind
from conformance.contract.pack import Contract
from conformance.documents.resources import matching
from conformance.scenarios.rule import Rule
from conformance.scenarios.survey import Probe, Survey
from conformance.statement.statement import empty_statement
from conformance.transport.exchange import Exchange
from conformance.verdict.case import Case
from conformance.verdict.run import Run

SECURITY: Final = "description/security"


def fails_by_description(contract: Contract, base_url: str, requirement: str, exchange: Exchange) -> bool:
    """Return whether one exchange fails a rule that compares single responses with the description."""
    # Imported late: the rules of described devices take a tenth of a second.
    from conformance.rules.description import test_answers, test_security  # noqa: PLC0415

    found = (value for module in (test_answers, test_security) for value in vars(module).values())
    rule = next((one for one in found if isinstance(one, Rule) and one.requirement == requirement), None)
    path = exchange.request.url.removeprefix(base_url.rstrip("/")).partition("?")[0]
    operation = matching(contract, exchange.request.method, path) if rule else None
    if rule is None or operation is None:
        return False
    trace = (exchange,) if requirement == SECURITY else Survey((Probe(operation.label, Kind.USUAL, exchange=exchange),))
    run = Run(empty_statement(contract), contract)
    return any(isinstance(one, Case) and not one.holds for one in rule.outcomes(trace, {"run": run}.__getitem__))
