"""Reads in company: directly after refusals, with HEAD between two GETs, with queries, and with conditions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle, islice
from typing import Final

from conformance.api.rest.applicable import allows
from conformance.api.rest.inputs import Inputs, request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, Variation, valid_variations
from conformance.documents.openapi import Operation, operations_of
from conformance.scenarios.estimate import TIMED_AGAIN
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import REFUSALS, Survey, Surveyor
from conformance.transport.exchange import Exchange, Outgoing

#: An entity tag that no content has.
NO_TAG: Final = '"roaas-nothing-has-this-tag"'
_TRIED = 3  # values of an id that are tried
_QUERIES = 3  # queries of one operation
_AT_QUICK = 8  # operations and queries at quick, together
# Refusals before each read at standard effort; at quick two.
_REFUSALS: Final = 8
# Reads of each operation: with the timed reads at the end, one wrong response in twenty is found.
_READS: Final = 20 - TIMED_AGAIN
_LONG: Final = 8  # bytes that content needs before parts of it are requested
_PARTS: Final = ((("Range", "bytes=2-5"),), (("Range", "bytes=-4"),), (("Range", "bytes=0-3"), ("If-Range", NO_TAG)))
# Usual response time below which operations are read more often, ms.
_QUICK_MS: Final = 50.0
_FEW_READS: Final = 2


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.ACTING)
def neighbours(api: RestInterface, values: Values) -> Survey:
    """Read each operation directly after refused requests, by HEAD between two GETs, and again and again."""
    slow = api.streams | api.slow
    reads = [
        item
        for item in operations_of(api.run.contract)
        if item.method == "GET" and allows(api, item) and item.label not in slow
    ]
    surveyor = Surveyor(api, values)
    found = _refusals(api)
    refusals = cycle(found or [None])
    is_quick = api.run.effort.name == "quick" or api.run.effort.slow
    queries = _AT_QUICK if is_quick else len(reads) * _QUERIES
    for read in api.run.effort.subsample(reads, _FEW_READS):
        usual = _after(surveyor, read, usual_inputs(read, values)[:_TRIED], refusals)
        if usual is None:
            continue
        _head(surveyor, read, usual)
        last = surveyor.probes[-2].exchange
        _read_cached(surveyor, read, usual, last)
        _parts(surveyor, read, usual, last)
        for _ in found[: 1 if is_quick else _REFUSALS]:
            _after(surveyor, read, [usual], refusals)
        for inputs in islice(_queries(read, usual, values), min(queries, _QUERIES)):
            queries -= 1
            if surveyor.send(read, Variation(Kind.AGAIN, "", "", inputs)).ok:
                _head(surveyor, read, inputs)
                surveyor.send(read, Variation(Kind.AGAIN, "", "", inputs))
        if not (read.parameters or api.run.effort.slow) and api.run.effort.usual_ms < _QUICK_MS:
            for turn in range(api.reads[read.label], _READS):
                surveyor.send(read, Variation(Kind.AGAIN, "", "", usual), fresh=turn % 2 == 0)
    return surveyor.trace


def _refusals(api: RestInterface) -> list[tuple[Operation, Outgoing]]:
    """Return requests that the device refused: one for each status first, those with content before others."""
    by_label = {item.label: item for item in operations_of(api.run.contract)}
    by_status: dict[int, list[tuple[Operation, Outgoing]]] = {}
    for (status, label), request in sorted(api.refused.items(), key=lambda one: not one[1].body):
        if label in by_label and status in REFUSALS:
            by_status.setdefault(status, []).append((by_label[label], request))
    most = max(map(len, by_status.values()), default=0)
    return [found[turn] for turn in range(most) for found in by_status.values() if turn < len(found)]


def _after(
    surveyor: Surveyor, read: Operation, tried: list[Inputs], refusals: Iterator[tuple[Operation, Outgoing] | None]
) -> Inputs | None:
    """Send a refused request, and read on the same connection; return the read's inputs, if it got 2xx."""
    for inputs in tried:
        refused = next(refusals)
        if refused is not None:
            surveyor.send(refused[0], Variation(Kind.ODD, "", "", Inputs()), refused[1], fresh=False)
        if surveyor.send(read, Variation(Kind.AGAIN, "", "", inputs), fresh=False).ok:
            return inputs
    return None


def _read_cached(surveyor: Surveyor, read: Operation, inputs: Inputs, last: Exchange | None) -> None:
    """Where the last read had an entity tag, read by conditions of clients that have that copy, or another one."""
    tag = (last.response.header("etag") or "") if last is not None else ""
    request = request_of(read, inputs)
    conditions = [("GET", text) for text in (tag, f"{NO_TAG}, {tag}", f"W/{tag.removeprefix('W/')}", NO_TAG)]
    for method, tags in (*conditions, ("HEAD", tag)) if tag else ():
        conditional = replace(request, method=method, headers=(*request.headers, ("If-None-Match", tags)))
        surveyor.send(read, Variation(Kind.ODD, "", "", inputs), conditional, fresh=False)


def _parts(surveyor: Surveyor, read: Operation, inputs: Inputs, last: Exchange | None) -> None:
    """If the device supports ranges, read parts of the last content and of another copy; then the whole."""
    if last is None or len(last.response.body) < _LONG:
        return
    if "206" not in read.responses and (last.response.header("accept-ranges") or "").strip().lower() != "bytes":
        return
    read_parts(surveyor, read, request_of(read, inputs))


def read_parts(surveyor: Surveyor, read: Operation, whole: Outgoing, *, more: bool = True) -> None:
    """Read a part of a content and its end, with ``more`` also of another copy, and the whole."""
    for fields in _PARTS if more else _PARTS[:1]:
        part = replace(whole, headers=(*whole.headers, *fields))
        surveyor.send(read, Variation(Kind.ODD, "", "", Inputs()), part, fresh=False)
    surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole, fresh=False)


def _head(surveyor: Surveyor, read: Operation, inputs: Inputs) -> None:
    """Send HEAD in place of a GET."""
    request = replace(request_of(read, inputs), method="HEAD")
    surveyor.send(read, Variation(Kind.ODD, "", "", inputs), request, fresh=False)


def _queries(read: Operation, usual: Inputs, values: Values) -> Iterator[Inputs]:
    """Yield the usual request with one parameter more in its query, each once."""
    seen: set[str] = set()
    for variation in valid_variations(read, usual, values):
        if variation.place.startswith("query ") and variation.place not in seen:
            seen.add(variation.place)
            yield variation.inputs
