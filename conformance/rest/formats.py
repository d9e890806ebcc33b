"""One state in several formats: read each, and compare value by value."""

from dataclasses import dataclass
from typing import Any

from conformance.documents.json_schema import Schema
from conformance.documents.representation import UnreadableError, flattened, read
from conformance.rest.calls import JSON, Call
from conformance.rest.interface import RestInterface
from conformance.rest.snapshot import steady
from conformance.transport.exchange import Exchange

# A robot at rest jitters; what its formats say otherwise in so many turns in a row is no jitter.
_TURNS = 10


@dataclass(frozen=True)
class Disagreement:
    """One value that two formats tell differently.

    Attributes:
        place: which.
        description: what each says.
        exchange: the answer that disagrees with JSON.
    """

    place: str
    description: str
    exchange: Exchange


def disagreements(api: RestInterface, call: Call, media_types: list[str]) -> tuple[list[Disagreement], Exchange]:
    """Read a resource as JSON, in the other formats, and as JSON again, until all say the same.

    Only what both JSON answers say alike is compared, so that what changes between two reads blames nobody; what
    differs in every turn, at the same place, is a disagreement.

    Returns:
        What disagrees in every turn; and the last JSON exchange.
    """
    schema = call.operation.shape or {}
    suspects: dict[tuple[str, str], Disagreement] | None = None
    exchange = None
    for _ in range(_TURNS):
        first = call.send(api, ("Accept", JSON))
        others = [(name, call.send(api, ("Accept", name))) for name in media_types]
        exchange = call.send(api, ("Accept", JSON))
        snapshots = [_snapshot(item, JSON, schema) for item in (first, exchange)]
        if any(shown is None for shown in snapshots):
            return [], exchange  # what is wrong with that, others judge
        known = steady(shown for shown in snapshots if shown is not None)
        found = {
            (name, item.place): item
            for name, other in others
            for item in _compare(known, snapshots, _snapshot(other, name, schema), name, other)
        }
        suspects = found if suspects is None else {key: item for key, item in found.items() if key in suspects}
        if not suspects:
            break
    if exchange is None:
        raise AssertionError("unreachable: there is at least one turn")
    return list((suspects or {}).values()), exchange


def judge_same_values(api: RestInterface, call: Call, media_types: list[str]) -> Exchange:
    """Judge that the formats of a resource agree, where it can be read; give the last JSON exchange."""
    found, exchange = disagreements(api, call, media_types)
    first = found[0] if found else None
    if exchange.response.ok:
        api.run.judge.check(
            "rest-formats/same-values",
            first is None,
            first.exchange if first else exchange,
            f"the same values in all formats of {call.operation.template}",
            found=first.description if first else "",
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
        Disagreement(place, f"{place} is {other.get(place, 'nothing')!r} in {name} and {value!r} in JSON", exchange)
        for place, value in known.items()
        if not _same(value, other.get(place, None if value is None else ...))
    ]
    everywhere = set().union(*(shown or {} for shown in snapshots))
    found += [
        Disagreement(place, f"{place} is {value!r} in {name} and nothing in JSON", exchange)
        for place, value in other.items()
        if place not in everywhere
    ]
    return found


def _same(value: Any, other: Any) -> bool:
    return type(value) is type(other) and bool(value == other)
