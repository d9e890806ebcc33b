"""Convert a JSON body as a lenient server may: to values of the declared types with the same meaning."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Collection, Iterator
from typing import Any

from conformance.api.rest.inputs import NOTHING
from conformance.api.rest.patches import same
from conformance.api.rest.samples import fits
from conformance.api.rest.variations import Steps, with_member
from conformance.documents.json_schema import Schema
from conformance.documents.json_text import read_json
from conformance.documents.representation import flat

# JSON's words and numbers, and the words of YAML 1.1, which pydantic takes as well.
_WORDS = dict.fromkeys(("1", "true", "t", "yes", "y", "on"), True) | dict.fromkeys(
    ("0", "false", "f", "no", "n", "off"), False
)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?", re.ASCII)
_YEAR_3000 = 32_503_680_000
_Place = tuple[Steps, list[Any]]


def is_converted(schema: Schema, sent: bytes, response: bytes, unkept: Collection[str] = ()) -> bool:
    """Return whether a forbidden body has an allowed one of the same meaning, and the response shows no other values.

    Each value is allowed in another JSON type: 0 for false, "5" for 5, one item for a list of one, a set that repeats
    an item, null for an optional member. The response may show anything for ``unkept`` members.
    """
    body = read_json(sent)
    if body.problem or fits(schema, body.value):
        return False
    found = list(_conversions(schema, body.value, ()))
    if not found or not all(meanings for _, meanings in found):
        return False
    meant = body.value
    for steps, meanings in found:
        meant = with_member(meant, steps, meanings[0]) if steps else meanings[0]
    said = read_json(response).value
    return fits(schema, meant) and all(
        (steps[:1] and steps[0] in unkept) or _shows(said, steps, meanings) for steps, meanings in found
    )


def unkept_members(sent: bytes, response: bytes) -> set[str]:
    """Return the members of a body for which the response shows another value, as another setting may decide it."""
    body, said = read_json(sent).value, read_json(response).value
    members = body.items() if isinstance(body, dict) else ()
    return {name for name, value in members if not _shows(said, (name,), [value])}


def _conversions(schema: Schema, value: Any, here: Steps) -> Iterator[_Place]:
    """Yield each forbidden scalar or set within a value with the allowed values of its meaning."""
    if fits(schema, value):
        return
    merged = flat(schema)
    if isinstance(value, dict):
        parts = merged.get("properties", {})
        for name, item in value.items():
            part = parts.get(name, {})
            if item is None and name not in merged.get("required", ()) and not fits(part, None):
                yield (*here, name), [NOTHING]
            else:
                yield from _conversions(part, item, (*here, name))
    elif isinstance(value, list):
        items = merged.get("items")
        for index, item in enumerate(value):
            yield from _conversions(items if isinstance(items, dict) else {}, item, (*here, index))
        once = [item for index, item in enumerate(value) if not any(same(item, other) for other in value[:index])]
        if merged.get("uniqueItems") is True and len(once) < len(value):
            yield here, [once]
    else:
        items = merged.get("items")
        alone = [value, *(_meanings(items, value) if isinstance(items, dict) else ())]
        either = [*_meanings(merged, value), *([item] for item in alone if item is not None)]
        yield here, [meant for meant in either if fits(schema, meant)]


def _meanings(schema: Schema, value: Any) -> Iterator[Any]:
    """Yield values of other types that mean the same as a scalar."""
    if isinstance(value, str):
        yield from _of_text(value.strip())
    elif isinstance(value, bool):
        yield from (int(value), str(value).lower(), str(value))
    elif value is not None:
        yield from (*([bool(value)] if value in {0, 1} else ()), str(value), f"{value:g}")
        if flat(schema).get("format") == "date-time" and 0 <= value < _YEAR_3000:
            moment = dt.datetime.fromtimestamp(value, dt.UTC).isoformat()
            yield from (moment.replace("+00:00", "Z"), moment)


def _of_text(text: str) -> Iterator[Any]:
    if text.lower() in _WORDS:
        yield _WORDS[text.lower()]
    if _NUMBER.fullmatch(text) and math.isfinite(number := float(text)):
        yield int(text) if text.lstrip("+-").isdecimal() else number


def _shows(said: Any, steps: Steps, meanings: list[Any]) -> bool:
    """Return whether a response shows a member with one of these values, or does not show it."""
    value = _at(said, steps)
    if value is NOTHING or meanings[0] is NOTHING:
        return True
    return any(same(value, meant) or _is_alike(value, meant) for meant in meanings)


def _is_alike(one: Any, other: Any) -> bool:
    """Return whether two lists have the same items in any order, or two texts the same number, as 0 and 0.00."""
    if isinstance(one, str) and isinstance(other, str) and _NUMBER.fullmatch(one) and _NUMBER.fullmatch(other):
        return float(one) == float(other)
    return isinstance(one, list) and isinstance(other, list) and sorted(map(str, one)) == sorted(map(str, other))


def _at(said: Any, steps: Steps) -> Any:
    """Return the value at a place of a response, or at this place within one of its members; else NOTHING."""
    value = said
    try:
        for step in steps:
            value = value[step]
    except (KeyError, IndexError, TypeError):
        inner = [item for item in said.values() if isinstance(item, dict)] if isinstance(said, dict) else []
        return next((found for item in inner if (found := _at(item, steps)) is not NOTHING), NOTHING)
    return value
