"""Read one state in several formats by Accept (RFC 9110 12.5.1), and compare the values."""

import itertools
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

from conformance.api.expectation import expect
from conformance.api.rest.calls import JSON, Call
from conformance.api.rest.effects import steady
from conformance.api.rest.interface import RestInterface
from conformance.documents.json_schema import Schema
from conformance.documents.representation import UnreadableError, flattened, read
from conformance.transport.exchange import Exchange, Outgoing
from conformance.transport.parallel import MOST_CLIENTS, send_together

# A robot at rest jitters: only a difference in this many rounds in a row counts.
_TURNS = 10
# In this many of the rounds, a response to simultaneous requests must differ: in the others it may have come first.
_AT_ONCE = 8


@dataclass(frozen=True)
class Disagreement:
    """One value that differs between two formats.

    Attributes:
        place: path of the value.
        description: the value in both formats.
        exchange: the exchange whose response differs from JSON.
    """

    place: str
    description: str
    exchange: Exchange


# Differences between two formats, by format and place.
Found = dict[tuple[str, str], Disagreement]
#: Function that reads a resource in the given formats, and returns each format with its exchange.
Reader = Callable[[RestInterface, Call, list[str]], list[tuple[str, Exchange]]]


def in_turn(api: RestInterface, call: Call, media_types: list[str]) -> list[tuple[str, Exchange]]:
    """Read a resource in each format, one after another."""
    return [(name, call.send(api, ("Accept", name))) for name in media_types]


def each_after(event: Callable[[], object]) -> Reader:
    """Return a reader that calls ``event`` before each format, and prefers it to the others, as many clients do."""

    def read_each(api: RestInterface, call: Call, media_types: list[str]) -> list[tuple[str, Exchange]]:
        found: list[tuple[str, Exchange]] = []
        for name in media_types:
            event()
            rather = [f"{other};q=0.2" for other in call.operation.formats if other != name]
            found.append((name, call.send(api, ("Accept", ", ".join((name, *rather))))))
        return found

    return read_each


def at_once(api: RestInterface, call: Call, media_types: list[str]) -> list[tuple[str, Exchange]]:
    """Read a resource in each format at the same moment, by several clients; a busy robot may leave some out."""
    names = [*media_types, *itertools.repeat(JSON, MOST_CLIENTS)][:MOST_CLIENTS]
    round_ = [(api.client, Outgoing("GET", call.path, (("Accept", name),))) for name in names]
    attempts = zip(media_types, send_together([round_])[0], strict=False)
    return [(name, one) for name, one in attempts if isinstance(one, Exchange)]


def _nothing() -> None:
    """Do nothing before a comparison."""


def disagreements(
    api: RestInterface,
    call: Call,
    media_types: list[str],
    renew: Callable[[], object] = _nothing,
    reader: Reader = in_turn,
) -> tuple[list[Disagreement], Exchange]:
    """Read a resource as JSON, in the other formats, and as JSON again, repeatedly until all agree.

    Only values that are equal in both JSON responses are compared, as others change by themselves. A disagreement is a
    value that differs at the same place every time, or nearly so where all formats are read at once.

    Returns:
        The disagreements, and the last JSON exchange.
    """
    suspects: Found = {}
    times: Counter[tuple[str, str]] = Counter()
    least = _AT_ONCE if reader is at_once else _TURNS
    for left in reversed(range(_TURNS)):
        renew()
        found, exchange = one_turn(api, call, media_types, reader)
        suspects |= found
        times.update(found.keys())
        if all(count + left < least for count in times.values()):
            break
    return [item for key, item in suspects.items() if times[key] >= least], exchange


def one_turn(
    api: RestInterface, call: Call, media_types: list[str], reader: Reader = in_turn
) -> tuple[Found, Exchange]:
    """Read a resource once as JSON, in the other formats, and as JSON again.

    Returns:
        The disagreements by format and place (empty if the JSON is invalid, which other checks report), and the last
        JSON exchange.
    """
    schema = call.operation.shape or {}
    first = call.send(api, ("Accept", JSON))
    others = reader(api, call, media_types)
    last = call.send(api, ("Accept", JSON))
    snapshots = [_snapshot(item, JSON, schema) for item in (first, last)]
    if any(shown is None for shown in snapshots):
        return {}, last
    known = steady(shown for shown in snapshots if shown is not None)
    return {
        (name, item.place): item
        for name, other in others
        for item in _compare(known, snapshots, _snapshot(other, name, schema), name, other)
    }, last


def judge_same_values(api: RestInterface, call: Call, media_types: list[str], reader: Reader = in_turn) -> Exchange:
    """Judge whether the formats of a resource agree; return the last JSON exchange.

    Args:
        api: the robot's REST interface.
        call: reads the resource.
        media_types: the formats to compare with JSON.
        reader: reads the resource in these formats.
    """
    found, exchange = disagreements(api, call, media_types, reader=reader)
    if exchange.response.ok:
        expect(api.run.judge, "rest-formats/same-values", found[0].exchange if found else exchange).that(
            not found,
            f"the same values in all formats of {call.operation.template}",
            found[0].description if found else "",
            cause=call.operation.id,
        )
    return exchange


def _snapshot(exchange: Exchange, media_type: str, schema: Schema) -> dict[str, Any] | None:
    answer = exchange.response
    if not answer.ok or answer.media_type != media_type:
        return None
    try:
        return flattened(read(media_type, answer.body, schema))
    except UnreadableError:
        return None


def _compare(
    known: dict[str, Any],
    snapshots: list[dict[str, Any] | None],
    other: dict[str, Any] | None,
    name: str,
    exchange: Exchange,
) -> list[Disagreement]:
    if other is None:
        return []
    found = [
        Disagreement(place, f"{other.get(place, 'nothing')!r} as {place} in {name} and {value!r} in JSON", exchange)
        for place, value in known.items()
        if not (type(value) is type(there := other.get(place, None if value is None else ...)) and value == there)
    ]
    everywhere = set().union(*(shown or {} for shown in snapshots))
    found += [
        Disagreement(place, f"{value!r} as {place} in {name} and nothing in JSON", exchange)
        for place, value in other.items()
        if place not in everywhere
    ]
    return found


_DATA: Final = re.compile(r"[/+](?:x-)?(?:json|xml|yaml)\b")


def are_data(formats: Sequence[str]) -> bool:
    """Return whether several of these formats are structured data, so that one value can be written in each."""
    return sum(bool(_DATA.search(name)) for name in formats) > 1


_QUALITY = re.compile(r"0(?:\.\d{0,3})?|1(?:\.0{0,3})?", re.ASCII)


@lru_cache(maxsize=512)
def quality(media_type: str, accept: str | None) -> float:
    """Return the quality value of a media type by the most specific matching range; 0 if no range matches.

    A range with parameters also matches the type without them, since the server may choose.

    Args:
        media_type: in lower case, without parameters.
        accept: value of the header; None or empty accepts everything.
    """
    if accept is None or not accept.strip():
        return 1.0
    by_range: dict[str, float] = {}
    for member in accept.lower().split(","):
        name, *parameters = (part.strip() for part in member.split(";"))
        if name:
            by_range[name] = max(by_range.get(name, 0.0), _weight(parameters))
    for candidate in (media_type, f"{media_type.split('/', 1)[0]}/*", "*/*"):
        if candidate in by_range:
            return by_range[candidate]
    return 0.0


def _weight(parameters: list[str]) -> float:
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip() == "q":
            return float(value.strip()) if _QUALITY.fullmatch(value.strip()) else 0.0
    return 1.0


def accept_of(headers: tuple[tuple[str, str], ...]) -> str | None:
    """Return the request's Accept header, its lines joined, or None."""
    values = [value for name, value in headers if name.lower() == "accept"]
    return ", ".join(values) if values else None
