"""Read lists as CSV between two readings as JSON: they have the same rows, with the same values (RFC 4180)."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any, Final

from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.listing import listing_of, page_of
from conformance.api.rest.samples import fits
from conformance.api.rest.things import collection_of
from conformance.api.rest.values import Values
from conformance.documents.json_schema import is_number
from conformance.documents.json_text import clip
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import plain_name
from conformance.documents.xsd_shapes import number_in
from conformance.scenarios.creating import created_path
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer
from conformance.transport.exchange import Exchange, NoAnswerError

_CSV: Final = "text/csv"
_NEAR: Final = {"rel_tol": 0.01, "abs_tol": 0.01}  # how much a table may round numbers that JSON shows in full
_LARGEST: Final = 1 << 20
_CREATED: Final = 2  # things with quoted texts that are created
# Phrases in a description that name the separator.
_COMMAS: Final = re.compile(r"RFC\s*4180|\bcommas?\b|`\w+(?:,\s?\w+)+`", re.IGNORECASE)
# First characters of a text that a table may change, so that no program runs it as a formula.
_FORMULA: Final = ("=", "+", "-", "@", "\t")


@dataclass(frozen=True)
class Table:
    """A list as CSV.

    Attributes:
        operation: label of the operation that lists.
        shown: the response with CSV.
        fault: what is otherwise than in JSON, as a noun phrase; empty if there is none.
        expected: what should be there.
    """

    operation: str
    shown: Exchange
    expected: str
    fault: str = ""


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def tables(api: RestInterface, values: Values) -> tuple[Table, ...]:
    """Read each list that has CSV and JSON in both formats; a difference counts if it appears twice."""
    found, operations = list[Table](), callable_operations(api)
    gets = [one for (method, _), one in operations.items() if method == "GET"]
    reads = [operation for operation in gets if _CSV in operation.formats and any(map(is_json, operation.formats))]
    with _quoted_texts(api, values, operations if reads else {}):
        for create, read in ((operations.get(("POST", read.template.rstrip("/"))), read) for read in reads):
            if create is not None and read.parameter("path"):
                with suppress(NoAnswerError):
                    created_path(Surveyor(api, values), create, read)
        for read in reads:
            api.run.limit.check()
            with suppress(NoAnswerError):  # the survey reports a broken connection
                for compare in (_compare, _read_filtered):
                    first = compare(api, values, read)
                    again = compare(api, values, read) if first is not None and first.fault else first
                    found += [table for table in (again,) if table is not None]
    if not found:
        raise NoOccasionError("no list is declared as CSV and as JSON, and was the same twice")
    return tuple(found)


@contextmanager
def _quoted_texts(
    api: RestInterface, values: Values, operations: Mapping[tuple[str, str], Operation]
) -> Iterator[None]:
    """Create things with quotes in their texts, if the device accepts and later deletes them."""
    lives = [
        (create, read, delete)
        for (method, path), read in operations.items()
        for create, delete in [(operations.get(("POST", collection_of(path))), operations.get(("DELETE", path)))]
        if method == "GET" and create is not None and delete is not None and len(read.parameter("path")) == 1
    ][:_CREATED]
    made = list[tuple[Operation, Operation, str]]()
    with suppress(NoAnswerError):
        made += [(read, delete, created_path(Surveyor(api, values), create, read)) for create, read, delete in lives]
    yield
    with suppress(NoAnswerError):
        for read, delete, path in made:
            if path:
                Writer(api, values).conditional(delete, read, path)


def _compare(api: RestInterface, values: Values, read: Operation) -> Table | None:
    """Read a list as JSON, as CSV and as JSON; None if it has changed meanwhile, or is no list with the same names."""
    request = request_of(read, usual_inputs(read, values)[0])
    json_type = next(filter(is_json, read.formats))
    kept = tuple(pair for pair in request.headers if pair[0].lower() != "accept")
    before, table, after = (
        api.client.send("GET", request.target, headers=(*kept, ("Accept", name)))
        for name in (json_type, _CSV, json_type)
    )
    pages = [page_of(exchange.response, read) for exchange in (before, after)]
    answer = table.response
    if pages[0] is None or pages[1] is None or answer.media_type != _CSV or not (answer.ok and before.response.ok):
        return None
    items = [item for item in pages[0].items if isinstance(item, dict)]
    if not items or pages[0].items != pages[1].items or len(items) < len(pages[0].items) or answer.cut:
        return None
    rows = _rows(table)
    columns, head = _columns(rows[0], items) if rows else {}, ",".join(rows[0]) if rows else ""
    other = next((text for text in ";\t|" if len(_columns(head.split(text), items)) > len(columns)), "")
    if other and _COMMAS.search(read.text):
        expected = "values that commas separate, as the description says (RFC 4180 2)"
        return Table(read.label, table, expected, f"{other!r} between the names in the first line")
    if len(columns) < 2:  # noqa: PLR2004 - one name may be chance
        return None
    is_paged = pages[0].goes_on or (listing_of(read) is not None and len(rows) - 1 > len(items))
    fault = next(_differences(rows[1:], items, columns, is_paged=is_paged), "")
    return Table(read.label, table, f"the {len(items)} items that JSON has before and after, one a row", fault)


def _read_filtered(api: RestInterface, values: Values, read: Operation) -> Table | None:
    """Read a filtered list as JSON and as CSV; None if JSON does not show that the filter excludes items."""
    listing, json_type = listing_of(read), next(filter(is_json, read.formats))

    def ask(media_type: str, **query: Any) -> Exchange:
        inputs = usual_inputs(read, values)[0]
        request = request_of(read, replace(inputs, query={**inputs.query, **query}, accept=media_type))
        return api.client.send("GET", request.target, headers=request.headers)

    page = page_of(ask(json_type).response, read)
    items = [item for item in page.items if isinstance(item, dict)] if page is not None else []
    for name, filter_ in listing.filters.items() if listing is not None else ():
        texts = list(dict.fromkeys(item[name] for item in items if isinstance(item.get(name), str)))
        if len(texts) < 2 or not fits(filter_.schema, texts[0]):  # noqa: PLR2004 - one shows no choice
            continue
        page = page_of(ask(json_type, **{filter_.name: texts[0]}).response, read)
        table = ask(_CSV, **{filter_.name: texts[0]})
        own = {item.get(name) for item in page.items if isinstance(item, dict)} if page is not None else set()
        rows = _rows(table)
        place = _columns(rows[0], items).get(name) if rows else None
        if own != {texts[0]} or place is None or not table.response.ok:
            return None
        others = [row[place] for row in rows[1:] if len(row) > place and row[place] in texts[1:]]
        expected = f"rows with {texts[0]} as {name} alone, as the list by {filter_.name} has them in JSON"
        return Table(read.label, table, expected, f"a row with {others[0]} as {name}" if others else "")
    return None


def _rows(table: Exchange) -> list[list[str]]:
    """Return the lines of a table; none if it is too large."""
    octets = table.response.body
    text = octets.decode("utf-8-sig", "replace") if len(octets) <= _LARGEST else ""
    return [row for row in csv.reader(io.StringIO(text)) if row]


def _columns(head: list[str], items: list[dict[str, Any]]) -> dict[str, int]:
    """Return by the name of a member the column that has its name."""
    places = {plain_name(name): place for place, name in enumerate(head)}
    return {name: places[plain_name(name)] for name in items[0] if plain_name(name) in places}


def _differences(
    rows: list[list[str]], items: list[dict[str, Any]], columns: dict[str, int], *, is_paged: bool
) -> Iterator[str]:
    """Yield differences of a table from JSON: number of rows, and numbers and identifiers in them."""
    if len(rows) != len(items):
        if not is_paged:
            yield f"{len(rows)} rows"
        return
    for number, (row, item) in enumerate(zip(rows, items, strict=True), 1):
        for name, place in columns.items():
            value, text = item.get(name), row[place].strip() if place < len(row) else ""
            other = number_in(text) if isinstance(value, int | float) and is_number(value) else None
            if other is not None and not math.isclose(float(value or 0), other, **_NEAR):
                yield f"{text} as {name} in row {number}, and {clip(value)} in JSON"
            if isinstance(value, str) and '"' in value and not _is_shown(value.strip(), text):
                yield f"{clip(text)} as {name} in row {number}, and {clip(value)} in JSON"


def _is_shown(value: str, text: str) -> bool:
    """Return whether a table shows a text, in short or in another encoding as well."""
    is_free = value.startswith(_FORMULA) or "\ufffd" in text or not value.isprintable()
    return is_free or value == text or value.startswith(text.rstrip(". \u2026"))
