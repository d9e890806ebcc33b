"""Record the requests to each operation of a described API and their responses, for the page's table of operations."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import parse_qsl

from conformance.api.call_rules import CallRules, Reason
from conformance.api.rest.left_behind import LeftBehind
from conformance.api.rest.statuses import ANY_TIME, need_of
from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import Operation, is_json, operations_of, resource_at
from conformance.documents.wsdl_pack import label_in, services_of
from conformance.statement.motion_calls import named_by
from conformance.transport.exchange import Exchange, Listener, Request, Unanswered
from conformance.verdict.finding import Finding

if TYPE_CHECKING:
    from conformance.api.rest.interface import RestInterface

_OK, _REDIRECT = 200, 300
_READ = 100_000  # bytes of a body that are searched for members of its schema
_ERRORS: Final = 400  # statuses from this one on are errors
# Statuses which say that the device's state forbids the operation; they prove as well as a success that it exists.
_OF_STATE: Final = frozenset({409, 423})
# A fault as the first element of a SOAP Body.
_FAULT: Final = re.compile(rb"Body[^<>]*>\s*<(?:[\w.-]+:)?Fault[\s/>]")


@dataclass
class _Record:
    """The exchanges of one operation."""

    sent: int = 0
    unanswered: int = 0
    succeeded: int = 0
    statuses: Counter[int] = field(default_factory=Counter)
    slowest_ms: float = 0.0
    parameters: set[str] = field(default_factory=set)
    branches: set[str] = field(default_factory=set)


class OperationLog(Listener):
    """Counts the exchanges of a run by operation.

    Args:
        contract: the description.
        base_url: URL below which the operations are.

    Attributes:
        left: what the run has created and changed so far.
    """

    def __init__(self, contract: Contract, base_url: str) -> None:
        self._contract, self._base_url = contract, base_url
        self._services = services_of(contract)
        self.left = LeftBehind(operations_of(contract), base_url)
        self._records: dict[str, _Record] = {item.label: _Record() for item in operations_of(contract)}
        self._branches = {
            (item.label, status, name): {f"{status}{branch}" for branch in branches_of(schema)}
            for item in operations_of(contract)
            for status, content in item.responses.items()
            for name, schema in content.items()
            if is_json(name)
        }

    def on_response(self, exchange: Exchange) -> None:
        """Count a response."""
        operation = self._operation(exchange.request)
        if operation is not None:
            record = self._count(operation, exchange.request)
            record.statuses[exchange.response.status] += 1
            record.succeeded += self._is_success(exchange)
            record.slowest_ms = max(record.slowest_ms, exchange.response.elapsed_ms)
            self._look_into(operation, record, exchange)
            if self._services is None or self._is_success(exchange):
                self.left.follow(operation, exchange)

    def tidy_up(self, api: RestInterface, longest_s: float) -> bool:
        """Delete what the run created, and write back what it changed, within a time; return whether it wrote."""
        return self._services is None and self.left.tidy_up(api, longest_s)

    def by_hand(self, exchange: Exchange) -> None:
        """Count the response to a request over a raw socket, and note what that has changed."""
        operation = self._operation(exchange.request)
        if operation is not None:
            record = self._records[operation.label]
            record.sent += 1
            record.statuses[exchange.response.status] += 1
            self.left.follow(operation, exchange)

    def on_no_response(self, request: Unanswered) -> None:
        """Count a request without a response."""
        operation = self._operation(request.request)
        if operation is not None:
            self._count(operation, request.request).unanswered += 1

    def _is_success(self, exchange: Exchange) -> bool:
        answer = exchange.response
        if self._services is not None and _FAULT.search(answer.body):
            return False
        return answer.status < _ERRORS or answer.status in _OF_STATE

    def _operation(self, request: Request) -> Operation | None:
        if not request.url.startswith(self._base_url):
            return None
        if self._services is not None:
            label = label_in(self._services, self._path(request), request.body)
            return next((item for item in operations_of(self._contract) if item.label == label), None)
        # Other checks send HEAD and OPTIONS to every path: they count where the description declares them.
        resource = resource_at(self._contract, self._path(request))
        return resource.operations.get(request.method) if resource else None

    def _path(self, request: Request) -> str:
        return request.url[len(self._base_url) :].partition("?")[0]

    def _look_into(self, operation: Operation, record: _Record, exchange: Exchange) -> None:
        """Record which alternatives of its schema a response's body shows, until all of them were seen."""
        response, key = exchange.response, operation.response_key(exchange.response.status)
        wanted = self._branches.get((operation.label, str(key), response.media_type), set())
        if wanted <= record.branches or len(response.body) > _READ:
            return
        try:
            value = json.loads(response.body)
        except (ValueError, RecursionError):
            return
        schema = operation.responses[str(key)][response.media_type]
        record.branches |= {f"{key}{branch}" for branch in branches_in(schema, value)}

    def _count(self, operation: Operation, request: Request) -> _Record:
        query = request.url.partition("?")[2]
        record = self._records[operation.label]
        record.sent += 1
        record.parameters |= {name for name, _ in parse_qsl(query, keep_blank_values=True)}
        record.parameters |= {item.name for item in operation.parameter("path")}
        record.parameters |= {name.lower() for name, _ in request.headers}
        return record

    def document(
        self,
        rules: CallRules,
        findings: Iterable[Finding],
        usual_status: Mapping[str, int] = MappingProxyType({}),
        mapped: Collection[str] = (),
    ) -> dict[str, Any]:
        """Return the matrix of operations and the coverage of the description, for result.json.

        Args:
            rules: what may be called.
            findings: findings of the run.
            usual_status: status of the last usual request, by operation.
            mapped: the calls that maps in the statement send in this run.
        """
        operations = operations_of(self._contract)
        numbers: dict[str, list[int]] = {}
        for finding in findings:
            for label in finding.operations:
                numbers.setdefault(label, []).append(finding.number)
        rows = [
            self._row(item, rules, usual_status) | {"findings": sorted(numbers.get(item.label, ()))}
            for item in operations
        ]
        sent_by_maps = named_by(mapped, [item.label for item in operations])
        for row in rows:
            if row["operation"] in sent_by_maps and not row["called"]:
                row["reason"] = f"{Reason.MAPPED}, and this run did not come to it"
        called = [item for item in operations if self._records[item.label].sent]
        info = self._contract.openapi.get("info")
        info = info if isinstance(info, dict) else {}
        return {
            "title": str(info.get("title", "")),
            "version": str(info.get("version", "")),
            "operations": rows,
            **({"left_behind": left} if (left := self.left.document()) else {}),
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
                "branches": [
                    sum(len(record.branches) for record in self._records.values()),
                    len({(label, branch) for (label, _, _), found in self._branches.items() for branch in found}),
                ],
            },
        }

    def nothing_shown(self, rules: CallRules) -> str:
        """Return why the run shows nothing about the device, and what it needs; empty if an operation succeeded."""
        reasons = {item: rules.decide(item) for item in operations_of(self._contract)}
        if any(record.succeeded for record in self._records.values()):
            return ""
        if sent := [record for record in self._records.values() if record.sent]:
            statuses = {status for record in sent for status in record.statuses}
            if not statuses:
                return "no operation was answered in time"
            if self._services is None and min(statuses) >= HTTPStatus.INTERNAL_SERVER_ERROR:
                return "no operation succeeded: each was answered 5xx"
            return "no operation succeeded; [values] in a statement names values that the device knows"
        # HEAD and OPTIONS do not make an operation count as called, because other checks send them too.
        if any(reason.may and item.method in {"HEAD", "OPTIONS"} for item, reason in reasons.items()):
            return ""
        why = next((f": {item.label}: {reason}" for item, reason in reasons.items() if not reason.may), "")
        return f"no operation could be called{why}"

    def labels_of(self, request: Request) -> set[str]:
        """Return the labels of a request's operation, or of all operations of its resource if it has none."""
        if self._services is not None:
            operation = self._operation(request)
            return {operation.label} if operation else set()
        resource = resource_at(self._contract, self._path(request)) if request.url.startswith(self._base_url) else None
        if resource is None:
            return set()
        own = resource.operations.get("GET" if request.method == "HEAD" else request.method)
        return {own.label} if own else {item.label for item in resource.operations.values()}

    def uncalled_labels(self, rules: CallRules) -> list[str]:
        """Return the labels of the operations that may be called and were sent nothing."""
        operations = operations_of(self._contract)
        return [
            operation.label
            for operation in operations
            if rules.decide(operation).may and not self._records[operation.label].sent
        ]

    def _has_sent(self, operation: Operation, name: str) -> bool:
        return bool({name, name.lower()} & self._records[operation.label].parameters)

    def _row(self, operation: Operation, rules: CallRules, usual_status: Mapping[str, int]) -> dict[str, Any]:
        record = self._records[operation.label]
        reason = rules.decide(operation)
        works = any(_OK <= status < _REDIRECT for status in record.statuses)
        need, values = ("", []) if works else need_of(operation, usual_status.get(operation.label, 0))
        keys = {operation.response_key(status) for status in record.statuses} - {None}
        return {
            "operation": operation.label,
            # A stop, and operations of a motion map, are sent even if no pattern of --call allows them.
            "called": reason.may or record.sent > 0,
            "reason": str(reason) if reason.may or not record.sent else "the motion map or the end of the run sends it",
            "requests": record.sent,
            "unanswered": record.unanswered,
            "statuses": {str(status): count for status, count in sorted(record.statuses.items())},
            "declared": list(operation.responses),
            "seen_declared": sorted(map(str, keys)),
            "need_no_declaration": sorted(map(str, ANY_TIME & record.statuses.keys())),
            "slowest_ms": round(record.slowest_ms, 1),
            **({"needs": need} if need else {}),
            **({"values": values} if values else {}),
        }


_DEPTH: Final = 8
_ITEMS: Final = 20
_ALTERNATIVES: Final = 50


def branches_of(schema: Any, place: str = "", depth: int = 0) -> Iterator[str]:
    """Yield the name of each branch of a schema without references, to a limited depth."""
    if not isinstance(schema, dict) or depth > _DEPTH:
        return
    for part, inner in _parts(schema, place):
        if part:
            yield part
        yield from branches_of(inner, part or place, depth + 1)
    yield from branches_of(schema.get("items"), f"{place}[]", depth + 1)


def branches_in(schema: Any, value: Any, place: str = "", depth: int = 0) -> Iterator[str]:
    """Yield the name of each branch of a schema that a value shows."""
    if not isinstance(schema, dict) or depth > _DEPTH:
        return
    if isinstance(value, list):
        for item in value[:_ITEMS]:
            yield from branches_in(schema.get("items"), item, f"{place}[]", depth + 1)
    for part, inner in _parts(schema, place):
        name = part.removeprefix(f"{place}.")
        if not part:
            yield from branches_in(inner, value, place, depth + 1)
        elif name == part:
            if _fits(inner, value):
                yield part
                yield from branches_in(inner, value, part, depth + 1)
        elif isinstance(value, dict) and name in value:
            yield part
            yield from branches_in(inner, value[name], part, depth + 1)


def _parts(schema: Schema, place: str) -> Iterator[tuple[str, Any]]:
    """Yield the branches of a schema with their schemas, and its parts that always hold with an empty name."""
    properties = schema.get("properties")
    for name, inner in properties.items() if isinstance(properties, dict) else ():
        yield f"{place}.{name}", inner
    for key in ("anyOf", "oneOf"):
        for number, inner in enumerate(schema.get(key, ())[:_ALTERNATIVES]):
            yield f"{place}|{key} {number}", inner
    for inner in schema.get("allOf", ()):
        yield "", inner


def _fits(schema: Any, value: Any) -> bool:
    try:
        return not isinstance(schema, dict) or shape_of(schema).holds(value)
    except (ValueError, TypeError):
        return False  # no schema that a validator can use
