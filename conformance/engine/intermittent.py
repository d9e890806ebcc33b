"""Whether a failure comes back: what fails once in a while is told as such, and is a failure all the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

from conformance.engine.sending_again import is_same, send_again
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Again

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conformance.transport.client import Connection
    from conformance.verdict.evidence import Finding
    from conformance.verdict.run import Run

# Methods that may be sent again without leave (RFC 9110 9.2.1).
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
_TIMES = 5
_MOST = 20


def look_again(run: Run, connection: Connection) -> None:
    """Send the request of each finding again, where that is safe, and put down how often the failure came back.

    Where an observer judges the requirement by every answer, its word counts; else an answer of the same kind.
    """
    for id_, finding in list(_safe(run))[:_MOST]:
        if finding.exchange is None or not isinstance(finding.exchange, Exchange):
            continue
        evidence = run.judge.evidence[id_]
        came_back = 0
        for _ in range(_TIMES):
            cases, seen = evidence.cases, evidence.failures
            answer = send_again(finding.exchange.request, connection)
            judged = evidence.cases > cases
            came_back += evidence.failures > seen if judged else is_same(finding.exchange.response, answer)
        finding.again = Again(came_back, _TIMES)


def _safe(run: Run) -> Iterator[tuple[str, Finding]]:
    for id_, evidence in run.judge.evidence.items():
        if run.contract.ledger[id_].class_ not in run.claims:
            continue
        for finding in list(evidence.findings.values()):
            request = finding.exchange.request if finding.exchange else None
            if request is not None and request.raw is None and request.method in _SAFE and not request.body:
                yield id_, finding
