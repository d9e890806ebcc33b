"""The ways in by which each requirement is judged: recorded in a run on a good device, and shown as tables.

A requirement that is judged over one interface, one resource or one format alone says nothing of the others.
"""

import json
import re
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from string import ascii_lowercase
from typing import Any, Final

from conformance.api.rest.request_context import RequestContext
from conformance.contract.ledger import Requirement
from conformance.contract.pack import Contract
from conformance.engine.certification import certify
from conformance.selftest.certifying import job_at, robot_of
from conformance.selftest.generated.places import exchanges
from conformance.selftest.robots import Robot
from conformance.selftest.ways_argued import FILE as REASONS
from conformance.selftest.ways_argued import TRAITS, Argument, Arguments, arguments_in
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run

#: Beside a pack's ledger: the number of judged cases by requirement and way in.
FILE: Final = "ways.json"
_NEGATIVE: Final = re.compile(rb"(?<![\w.])-\d")
_CLAUSE: Final = re.compile(r"contract\.md#([\w-]+)")
_SOAP_BODY: Final = re.compile(rb"<(?:[\w.-]+:)?Body[^>]*>\s*<(?:[\w.-]+:)?([\w.-]+)")
_SEEN: Final = 20_000
Ways = Mapping[str, Mapping[str, int]]


class _Recording(Judge):
    """A judge that counts the cases of each requirement by the ways in of their requests."""

    def __init__(self, run: Run, base_url: str) -> None:
        super().__init__(run.contract.ledger)
        self.ways: dict[str, Counter[str]] = defaultdict(Counter)
        self._contract, self._base_url = run.contract, base_url.rstrip("/")
        self._soap = {exchange.name for exchange in exchanges(run.contract) if exchange.side == "soap"}
        self._seen: set[int] = set()

    def check(self, requirement: str, holds: bool, exchange: Attempt | None, expected: str, **more: Any) -> bool:  # noqa: FBT001 - as Judge has it
        """Count a case."""
        known = self._renamed.get(requirement, requirement)
        if exchange is not None and known in self.evidence:
            self.ways[known].update(self._ways_of(exchange))
        return super().check(requirement, holds, exchange, expected, **more)

    def _ways_of(self, attempt: Attempt) -> Iterator[str]:
        request = attempt.request
        fields = {name.lower(): value for name, value in request.headers}
        media_type = fields.get("content-type", "")
        if "soapaction" in fields or b"Envelope" in request.body[:400]:
            found = _SOAP_BODY.search(request.body)
            name = found[1].decode("latin-1") if found else ""
            if name not in self._soap:
                return
            yield f"SOAP {name}"
        else:
            context = RequestContext.of(self._contract, self._base_url, request)
            if context is None or context.operation is None:
                return
            if not request.body and isinstance(attempt, Exchange):
                media_type = attempt.response.media_type if attempt.response.ok else ""
            yield f"{context.operation.id}{_format(media_type)}"
        if _NEGATIVE.search(request.url.encode("latin-1", "replace") + b" " + request.body):
            yield TRAITS[0]
        key = hash((request.method, request.url, request.body))
        if key in self._seen:
            yield TRAITS[1]
        elif len(self._seen) < _SEEN:
            self._seen.add(key)


def _format(media_type: str) -> str:
    kinds = {"xml": " XML", "text/plain": " text"}
    return next((name for kind, name in kinds.items() if kind in media_type), "")


def recorded(robot: Robot, effort: str, seed: int) -> Ways:
    """Return the ways in by which a run on a good device judges each requirement.

    Raises:
        OSError: the run cannot write its result.
    """
    with tempfile.TemporaryDirectory() as folder:
        under_test = robot_of(job_at(robot, effort=effort, seed=seed, domain_id=robot.domain_id), Path(folder))
        judge = under_test.run.judge = _Recording(under_test.run, robot.rest)
        certify(under_test, Path(folder), progress=None)
    ledger = under_test.run.contract.ledger
    return {id_: dict(sorted(judge.ways[id_].items())) for id_ in ledger if judge.ways[id_]}


def of_pack(contract: Contract) -> Ways:
    """Return what was recorded of a pack; empty if nothing was."""
    path = contract.directory / FILE
    found: Ways = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return found


def tables(contract: Contract) -> list[str]:
    """Return lines of Markdown: a table of each clause of the contract, its requirements and the ways into it.

    Raises:
        WaysFileError: the pack's arguments cannot be used.
    """
    ways, arguments = of_pack(contract), arguments_in(contract.directory) or Arguments()
    if not ways:
        return []
    lines = ["", "## Ways in", "", *_ABOUT]
    for clause, names, judged in _clauses(contract, ways):
        titles = " | ".join(f"`{name}`" if name not in TRAITS else name for name in names)
        lines += ["", f"### {clause}", "", f"| requirement | {titles} |", f"|---|{'---|' * len(names)}"]
        notes: dict[str, str] = {}
        for item in judged:
            cells = (_cell(ways[item.id].get(name), arguments.of(item.id, name), notes) for name in names)
            lines.append(f"| `{item.id}` | {' | '.join(cells)} |")
        lines += [""] * bool(notes) + [f"- ({letter}) {why}" for why, letter in notes.items()]
    return lines


def _cell(cases: int | None, reason: Argument | str, notes: dict[str, str]) -> str:
    """Return the text of a cell; the letter of a new argument is added to ``notes``."""
    if cases is not None:
        return str(cases)
    return reason if isinstance(reason, str) else f"({notes.setdefault(reason.why, ascii_lowercase[len(notes)])})"


def unargued(contract: Contract) -> Iterator[str]:
    """Yield a sentence for each cell without a case that the pack does not argue, and for each argument of no cell.

    Raises:
        WaysFileError: the pack's arguments cannot be used.
    """
    ways, arguments = of_pack(contract), arguments_in(contract.directory)
    if arguments is None:
        return
    cells = [(item.id, name) for _, names, judged in _clauses(contract, ways) for item in judged for name in names]
    for id_, way in cells:
        if way not in ways[id_] and not arguments.of(id_, way):
            yield f"{id_} is not judged by {way}, and {REASONS} does not say why"
    yield from arguments.unused(cells)


def _clauses(contract: Contract, ways: Ways) -> Iterator[tuple[str, dict[str, None], list[Requirement]]]:
    """Yield each clause with all ways by which any of its requirements is judged, and these requirements."""
    for clause, own in _by_clause(contract).items():
        there = sorted({way for item in own for way in ways.get(item.id, {}) if way not in TRAITS})
        judged = [item for item in own if item.id in ways]
        if there and judged:
            yield clause, dict.fromkeys([*there, *TRAITS]), judged


_ABOUT: Final = (
    "Each number says how many cases of a requirement were judged by requests for an operation, in JSON unless the",
    "column names another format, in a run at standard effort on the first good device (`roaas contract ways` records",
    "them). Columns are all ways by which any requirement of the clause was judged. A dot is an operation or a format",
    "that the requirement does not speak of: a rule on GET says nothing of PUT. A letter is a way by which it could be",
    "judged and was not, for the reason below the table. Both come from the pack's `ways.toml`.",
)


def _by_clause(contract: Contract) -> dict[str, list[Requirement]]:
    """Return the requirements of the contract by the first section of it that they name."""
    found: dict[str, list[Requirement]] = defaultdict(list)
    for item in contract.ledger.values():
        clause = _CLAUSE.search(item.source)
        if clause is not None and item.untestable is None and item.origin == "contract":
            found[clause[1]].append(item)
    return dict(sorted(found.items()))
