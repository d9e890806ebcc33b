"""Make values that a schema allows, from the schema alone."""

from __future__ import annotations

import json
import re
import string
from collections.abc import Mapping
from functools import lru_cache
from itertools import islice
from typing import Any, Final

from conformance.api.rest.references import is_free_text
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_shape import shape_of
from conformance.documents.patterns import for_python
from conformance.documents.representation import discriminator_of, flat

#: Texts with leading zeros, an umlaut, a combining mark, a character beyond the Basic Multilingual Plane, and
#: characters that formats escape.
TEXTS: Final = ('007 Zo\u00eb e\u0301 \U0001f916 a+b, & %41 \\ "', "007 Zo\u00eb e\u0301 \U0001f916")

_DEPTH = 6
_OPTIONAL = 1_000  # most optional members of a value
# Most required members and items of a value. Each member gets an equal share, because schemas may refer to
# each other without end.
_REQUIRED = 20_000
_DIGITS: Final = 12  # digits of a text that are varied
_HIGHER: Final = 2  # texts that have a digit which is too high
_LONGER: Final = 64  # characters by which a text is lengthened, at most
#: A valid text for each format that JSON Schema, OpenAPI or its registry names.
FORMATS: Mapping[str, str] = {
    "uuid": "3fa85f64-5717-4562-b3fc-2c963f66afa6",
    "date-time": "2026-01-31T12:00:00Z",
    "date": "2026-01-31",
    "time": "12:00:00Z",
    "duration": "PT1S",
    "email": "someone@example.com",
    "uri": "http://127.0.0.1/",
    "url": "http://127.0.0.1/",
    "hostname": "localhost",
    "ipv4": "127.0.0.1",
    "ipv6": "::1",
    "byte": "AA==",
    # Formats of numbers that are sent as texts.
    **dict.fromkeys(("int32", "int64", "uint32", "uint64", "float", "double", "decimal"), "1"),
}


def entry_of(schema: Schema | None) -> Schema | None:
    """Return the schema of the entries of a map; None of what has members of its own, or entries of any kind."""
    given = flat(schema or {})
    entry = given.get("additionalProperties")
    return entry if isinstance(entry, dict) and "properties" not in given else None


def fits(schema: Schema, value: Any) -> bool:
    """Return whether a schema allows a value; a schema that no validator reads allows all."""
    try:
        return shape_of(schema).holds(value)
    except ValueError:
        return True


def sample(schema: Schema, depth: int = 0, *, whole: bool = False) -> Any:
    """Return a value that a schema allows, if one can be made.

    Args:
        schema: without references.
        depth: how deep the value lies in another one.
        whole: whether objects get their optional members too.
    """
    return _make(schema, depth, (_OPTIONAL, _REQUIRED), whole=whole)


def _make(schema: Schema, depth: int, room: tuple[int, int], *, whole: bool) -> Any:
    """Return a value with at most these numbers of optional and of required parts."""
    schema = flat(_not_null(schema))
    named = [schema[key] for key in ("example", "const", "default") if key in schema]
    named += [value for key in ("examples", "enum") if isinstance(schema.get(key), list) for value in schema[key]]
    chosen = next((value for value in named if value is not None and fits(schema, value)), None)
    if chosen is not None:
        return chosen
    kinds = kinds_of(schema)
    if "object" in kinds:
        return _object(schema, depth, room, whole=whole)
    if "array" in kinds:
        return _array(schema, depth, room, whole=whole)
    if kinds & {"number", "integer"}:
        return _number(schema, "integer" if "number" not in kinds else "number")
    return True if kinds == {"boolean"} else _text(schema)


def backwards(schema: Schema, depth: int = 0) -> Schema:
    """Return a schema with the alternatives of its unions, and of its members' unions, in the opposite order."""
    turned = {key: schema[key][::-1] for key in ("anyOf", "oneOf") if isinstance(schema.get(key), list)}
    given = schema.get("discriminator")
    if isinstance(given, dict) and isinstance(given.get("mapping"), dict):
        turned["discriminator"] = {**given, "mapping": dict(reversed(given["mapping"].items()))}
    properties = schema.get("properties")
    if isinstance(properties, dict) and depth < _DEPTH:
        turned["properties"] = {name: backwards(part, depth + 1) for name, part in properties.items()}
    return {**schema, **turned}


def _not_null(schema: Schema) -> Schema:
    """Return a schema without the alternatives that allow only null."""
    unions = {key: schema[key] for key in ("anyOf", "oneOf") if isinstance(schema.get(key), list)}
    kept = {key: [part for part in parts if part.get("type") != "null"] for key, parts in unions.items()}
    return {**schema, **{key: parts for key, parts in kept.items() if parts}}


def _object(schema: Schema, depth: int, room: tuple[int, int], *, whole: bool) -> dict[str, Any]:
    properties = schema.get("properties", {})
    required = [name for name in schema.get("required", ()) if not properties.get(name, {}).get("readOnly")]
    optional = [name for name in properties if name not in required and not properties[name].get("readOnly")]
    names = required if len(required) <= room[1] and depth < _DEPTH else []
    names = names + optional if whole and len(names) + len(optional) <= room[0] and depth < _DEPTH else names
    if len(names) < room[1] and depth < _DEPTH:
        names = _demanded_names(schema, names, optional)
    share = _share(room, len(names))
    made = {name: _make(properties.get(name, {}), depth + 1, share, whole=whole) for name in names}
    return {**made, **_discriminating(schema, made)}


def _demanded_names(schema: Schema, names: list[str], optional: list[str]) -> list[str]:
    """Return the names with those that other keywords than ``required`` demand."""
    dependent, least = schema.get("dependentRequired", {}), schema.get("minProperties", 0)
    found = dict.fromkeys(names)
    for name in [*names, *optional[: max(0, int(least) - len(names))]]:
        found |= dict.fromkeys([name, *(dependent.get(name, ()) if isinstance(dependent, dict) else ())])
    return list(found)


def _share(room: tuple[int, int], count: int) -> tuple[int, int]:
    return room[0] // max(1, count), room[1] // max(1, count)


def _discriminating(schema: Schema, made: dict[str, Any]) -> dict[str, Any]:
    """Return the member whose value names the alternative of an object, if the schema leaves the value open."""
    name, known = discriminator_of(schema)
    return {name: known[0]} if known and name in made and made[name] not in known else {}


def _array(schema: Schema, depth: int, room: tuple[int, int], *, whole: bool) -> list[Any]:
    prefix = schema.get("prefixItems", [])
    least = max(int(schema.get("minItems", 0)), 1 if whole else 0)
    items = [_make(part, depth + 1, room, whole=False) for part in prefix]
    rest = schema.get("items") if isinstance(schema.get("items"), dict) else {}
    count = min(least, schema.get("maxItems", least), 64, room[1]) - len(items)
    for _ in range(count):
        item = _make(rest or {}, depth + 1, _share(room, count), whole=False)
        items.append(_another(rest or {}, item, items) if schema.get("uniqueItems") else item)
    return items


def alike_and_apart(schema: Schema) -> tuple[list[Any], list[Any]]:
    """Return two arrays of at least two items by a schema: of equal items, and of different ones; else empty ones.

    Whether the schema allows them is not looked into.
    """
    schema = flat(schema)
    items = schema.get("items")
    if not isinstance(items, dict) or schema.get("prefixItems"):
        return [], []
    apart = [first := sample(items, 1, whole=True)]
    for _ in range(max(2, min(int(schema.get("minItems", 2)), 64)) - 1):
        apart.append(_another(items, first, apart))
    return [first] * len(apart), apart if apart[0] != apart[1] else []


def _another(schema: Schema, item: Any, others: list[Any]) -> Any:
    """Return an item that differs from the given ones; the item itself if none can be made."""
    number = len(others)
    numbered = item + number if isinstance(item, int | float) else f"{item}{number}" if isinstance(item, str) else item
    candidates = [item, *flat(schema).get("enum", ()), numbered]
    return next((candidate for candidate in candidates if candidate not in others and fits(schema, candidate)), item)


def _number(schema: Schema, kind: str) -> Any:
    least, most = schema.get("minimum"), schema.get("maximum")
    if isinstance(schema.get("exclusiveMinimum"), int | float):
        least = schema["exclusiveMinimum"] + (1 if kind == "integer" else 1e-3)
    if isinstance(schema.get("exclusiveMaximum"), int | float):
        most = schema["exclusiveMaximum"] - (1 if kind == "integer" else 1e-3)
    value = 1 if least is None and most is None else least if least is not None else min(1, most)  # type: ignore[type-var] # numbers of a schema
    if isinstance(schema.get("multipleOf"), int | float) and value is not None:
        step = schema["multipleOf"]
        value = -(-value // step) * step
    return value


def _text(schema: Schema) -> str:
    named = FORMATS.get(str(schema.get("format", "")))
    if named is not None and fits(schema, named):
        return named
    length = max(1, int(schema.get("minLength", 1)))
    plain = ("roaas" if length <= len("roaas") <= schema.get("maxLength", 5) else "a" * length)[: 1 << 16]
    if "pattern" not in schema or fits(schema, plain):
        return plain
    return _matching(json.dumps(schema, default=str)) or plain


@lru_cache(maxsize=1024)
def _matching(encoded: str) -> str:
    """Return a short text that fits the pattern of a schema, given as JSON; or empty."""
    from hypothesis import Phase, find, settings  # noqa: PLC0415 - few schemas have a pattern
    from hypothesis.errors import HypothesisException  # noqa: PLC0415 - as above
    from hypothesis.strategies import from_regex  # noqa: PLC0415 - as above

    schema = json.loads(encoded)
    pattern = for_python(str(schema["pattern"]))
    if pattern is None:
        return ""
    try:
        # Leave out Hypothesis's explain phase, which takes seconds.
        phases = (Phase.generate, Phase.shrink)
        quiet = settings(database=None, derandomize=True, max_examples=200, phases=phases)
        return find(from_regex(pattern), lambda text: fits(schema, text) and text.isprintable(), settings=quiet)
    except (HypothesisException, re.error, ValueError):
        return ""


def beside_pattern(schema: Schema) -> list[str]:
    """Return texts that a schema excludes next to those that it allows: a digit higher by one, or a character more."""
    text = sample(schema)
    if not isinstance(text, str) or not text or not fits(schema, text):
        return []
    places = [place for place, char in enumerate(text) if char in string.digits][:_DIGITS]

    def having(place: int, digit: int) -> str:
        return f"{text[:place]}{digit}{text[place + 1 :]}"

    for place in places:
        # The highest digit that is allowed in each place.
        text = next((one for digit in range(9, 0, -1) if fits(schema, one := having(place, digit))), text)
    higher = [having(place, int(text[place]) + 1) for place in places[::-1] if text[place] != "9"]
    longer = (text + number * text[-1] for number in range(1, _LONGER))
    return [
        *islice((one for one in higher if not fits(schema, one)), _HIGHER),
        *islice((one for one in longer if not fits(schema, one)), 1),
    ]


def other_texts(schema: Schema, value: dict[str, Any]) -> dict[str, str]:
    """Return another text, beyond ASCII, for each free text of an object, also for one that is null."""
    parts = flat(schema).get("properties", {})
    texts = [name for name, one in value.items() if isinstance(one, str) or one is None]
    free = [name for name in texts if name in parts and is_free_text(parts[name])]
    found = {name: [text for text in TEXTS if text != value[name] and fits(parts[name], text)] for name in free}
    return {name: texts[0] for name, texts in found.items() if texts}
