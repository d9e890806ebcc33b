"""What a run sent to each operation of a described API, and what came back: the matrix on its page."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qsl

from conformance.api.call_rules import CallRules
from conformance.contract.pack import Contract
from conformance.documents.openapi import Operation, matching, operations_of
from conformance.transport.exchange import Exchange, Listener, Request, Unanswered


@dataclass
class _Record:
    """The exchanges of one operation."""

    sent: int = 0
    unanswered: int = 0
    statuses: Counter[int] = field(default_factory=Counter)
    slowest_ms: float = 0.0
    parameters: set[str] = field(default_factory=set)


class OperationLog(Listener):
    """Counts the exchanges of a run by operation.

    Args:
        contract: the description.
        base_url: URL below which the operations are.
    """

    def __init__(self, contract: Contract, base_url: str) -> None:
        self._contract, self._base_url = contract, base_url
        self._records: dict[str, _Record] = {item.label: _Record() for item in operations_of(contract)}

    def answered(self, exchange: Exchange) -> None:
        """Count a response."""
        record = self._count(exchange.request)
        if record is not None:
            record.statuses[exchange.response.status] += 1
            record.slowest_ms = max(record.slowest_ms, exchange.response.elapsed_ms)

    def unanswered(self, request: Unanswered) -> None:
        """Count a request without a response."""
        record = self._count(request.request)
        if record is not None:
            record.unanswered += 1

    def _count(self, request: Request) -> _Record | None:
        if not request.url.startswith(self._base_url) or request.method in {"HEAD", "OPTIONS"}:
            return None
        path, _, query = request.url[len(self._base_url) :].partition("?")
        operation = matching(self._contract, request.method, path)
        if operation is None:
            return None
        record = self._records[operation.label]
        record.sent += 1
        record.parameters |= {name for name, _ in parse_qsl(query, keep_blank_values=True)}
        record.parameters |= {item.name for item in operation.parameter("path")}
        record.parameters |= {name.lower() for name, _ in request.headers}
        return record

    def document(self, rules: CallRules) -> dict[str, Any]:
        """Return the matrix of operations and the coverage of the description, for result.json."""
        operations = operations_of(self._contract)
        rows = [self._row(item, rules) for item in operations]
        called = [item for item in operations if self._records[item.label].sent]
        return {
            "operations": rows,
            "coverage": {
                "operations": [len(called), len(operations)],
                "parameters": [
                    sum(self._has_sent(item, parameter.name) for item in called for parameter in item.parameters),
                    sum(len(item.parameters) for item in operations),
                ],
                "statuses": [
                    sum(len(row["seen_declared"]) for row in rows),
                    sum(len(item.responses) for item in operations),
                ],
            },
        }

    def _has_sent(self, operation: Operation, name: str) -> bool:
        return bool({name, name.lower()} & self._records[operation.label].parameters)

    def _row(self, operation: Operation, rules: CallRules) -> dict[str, Any]:
        record = self._records[operation.label]
        keys = {operation.response_key(status) for status in record.statuses} - {None}
        return {
            "operation": operation.label,
            "called": rules.decide(operation).may,
            "reason": str(rules.decide(operation)),
            "requests": record.sent,
            "unanswered": record.unanswered,
            "statuses": {str(status): count for status, count in sorted(record.statuses.items())},
            "declared": list(operation.responses),
            "seen_declared": sorted(map(str, keys)),
            "slowest_ms": round(record.slowest_ms, 1),
        }
