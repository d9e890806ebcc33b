"""Make up values that a schema may allow, near the limits that it sets."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Final

from conformance.documents.schema_sides import MANY, NAMED, ONE

_MOST: Final = 48
_FEW: Final = 6
_DEPTH: Final = 5
_FORMATS: Final = (
    "2024-02-29", "2024-02-29T10:00:00Z", "10:00:00Z", "P1D", "a@b.example", "b.example", "192.0.2.1", "2001:db8::1",
    "http://b.example/a", "/a", "0f8fad5b-d9cb-469f-a165-70867728950e",
)  # fmt: skip


class Witnesses:
    """Values made of what two schemas mention.

    Args:
        schemas: two schemas with their ``$defs``.
    """

    def __init__(self, schemas: Iterable[Any]) -> None:
        self._numbers: dict[float, None] = dict.fromkeys((0.5, 0, 1, -1, 7, 2**40, 2**70, 1e300))
        self._texts: dict[str, None] = dict.fromkeys(("", "roaas", "0", "a", "A b"))
        self._sizes: dict[int, None] = dict.fromkeys((0, 1, 2))
        self._members: dict[str, None] = {"roaas": None}
        self._values: list[Any] = []
        for schema in schemas:
            self._look(schema)
        for size in list(self._sizes)[:12]:
            self._texts["x" * size] = None

    def _look(self, schema: Any) -> None:
        if not isinstance(schema, dict):
            return
        for key, value in schema.items():
            if key in {"enum", "const"}:
                self._values += value if key == "enum" else [value]
            elif key == "multipleOf":
                self._numbers |= dict.fromkeys((value / 3, 1.5 * value, value, -value, 2 * value, 3 * value, 5 * value))
            elif isinstance(value, int | float) and not isinstance(value, bool):
                if key.startswith(("min", "max")) and key not in {"minimum", "maximum"}:
                    self._sizes |= dict.fromkeys(max(0, min(int(value) + more, 300)) for more in (-1, 0, 1))
                else:
                    self._numbers |= dict.fromkeys((value, value - 1, value + 1, value - 0.5, value + 0.5))
            elif key == "pattern":
                self._texts |= dict.fromkeys(_near(value))
            elif key == "format":
                self._texts |= dict.fromkeys(_FORMATS)
            elif key in {"required", "dependentRequired"}:
                others = value.values() if key == "dependentRequired" else ()
                self._members |= dict.fromkeys([*value, *(name for names in others for name in names)])
            self._look_below(key, value)

    def _look_below(self, key: str, value: Any) -> None:
        if key in ONE:
            self._look(value)
        elif key in MANY:
            for part in value:
                self._look(part)
        elif key in NAMED or key == "$defs":
            if key == "patternProperties":
                self._members |= dict.fromkeys(text for name in value for text in _near(name))
            elif key != "$defs":
                self._members |= dict.fromkeys(value)
            for part in value.values():
                self._look(part)

    def of(self, schema: Any, whole: Any, depth: int = 0) -> Iterator[Any]:
        """Yield values that a schema may allow; ``whole`` has its ``$defs``."""
        if schema is False or depth > _DEPTH:
            return
        given = schema if isinstance(schema, dict) else {}
        if "$ref" in given:
            target = whole.get("$defs", {}).get(given["$ref"].rpartition("/")[2], {})
            yield from self.of(target, whole, depth + 1)
        yield from given.get("enum", ())
        if "const" in given:
            yield given["const"]
        parts = [part for key in ("anyOf", "oneOf", "allOf") for part in given.get(key, ())]
        parts += [given[key] for key in ("if", "then", "else", "not") if key in given]
        inner = [list(islice(self.of(part, whole, depth + 1), _MOST)) for part in parts]
        yield from (value for values in inner for value in values)
        yield from _joined(inner)
        yield from self._by_type(given, whole, depth)

    def _by_type(self, given: dict[str, Any], whole: Any, depth: int) -> Iterator[Any]:
        kinds = given.get("type", ["null", "boolean", "number", "string", "array", "object"])
        kinds = [kinds] if isinstance(kinds, str) else kinds
        yield from (value for value in self._values if depth or not isinstance(value, dict | list))
        if "null" in kinds:
            yield None
        if "boolean" in kinds:
            yield from (True, False)
        if {"number", "integer"} & set(kinds):
            yield from self._numbers
        if "string" in kinds:
            yield from self._texts
        if "array" in kinds:
            yield from self._arrays(given, whole, depth)
        if "object" in kinds:
            yield from self._objects(given, whole, depth)

    def _arrays(self, given: dict[str, Any], whole: Any, depth: int) -> Iterator[Any]:
        yield []
        prefix = [self._few(part, whole, depth) for part in given.get("prefixItems", ())]
        rest = self._few(given.get("items", True), whole, depth)
        found = self._few(given["contains"], whole, depth) if "contains" in given else []
        first = [values[0] for values in prefix if values]
        for number, values in enumerate(prefix):
            yield first[: number + 1]
            yield from ([*first[:number], value, *first[number + 1 :]] for value in values)
        for value in (*found, *rest):
            yield [*first, value]
            yield [*first, value, value]
        for size in list(self._sizes)[:12]:
            yield (rest * (size // max(len(rest), 1) + 1))[:size]
            yield [*first, *rest[:1] * size]
            yield [*first, *found[:1] * size]

    def _objects(self, given: dict[str, Any], whole: Any, depth: int) -> Iterator[Any]:
        yield {}
        described = given.get("properties", {})
        required = given.get("required", ())
        others = given.get("additionalProperties", True)
        named = list(dict.fromkeys([*described, *required, *self._members]))[:_MOST]
        values = {
            name: self._few(next(
                (part for pattern, part in given.get("patternProperties", {}).items() if _matches(pattern, name)),
                described.get(name, others),
            ), whole, depth)
            for name in named
        }  # fmt: skip
        least = {name: values[name][0] for name in required if values.get(name)}
        full = {name: values[name][0] for name in described if values[name]} | least
        yield least
        yield full
        for name in named:
            for value in values[name]:
                yield {**least, name: value}
                yield {**full, name: value}
            yield {key: value for key, value in full.items() if key != name}
        for size in list(self._sizes)[:12]:
            yield {**least, **{f"roaas{number}": 1 for number in range(size - len(least))}}
        free = [name for name in named if values[name]]
        for number, name in enumerate(free[:_FEW]):
            for other in free[number + 1 : _FEW]:
                yield from ({**least, name: one, other: two} for one in values[name][:4] for two in values[other][:4])

    def _few(self, schema: Any, whole: Any, depth: int) -> list[Any]:
        """Return a few different values that a schema of a member may allow, of each type some."""
        if depth >= _DEPTH:
            return []
        found: dict[tuple[type, int], Any] = {}
        for value in islice(self.of(schema, whole, depth + 2), 4 * _MOST):
            kind = type(value)
            number = next((at for at in range(_FEW) if (kind, at) not in found), None)
            if number is not None and not any(value == one for (same, _), one in found.items() if same is kind):
                found[kind, number] = value
        return list(found.values())


def _joined(parts: list[list[Any]]) -> Iterator[Any]:
    """Yield objects that join those of several schemas."""
    objects = [[value for value in values if isinstance(value, dict)][:_FEW] for values in parts]
    found: list[dict[str, Any]] = [{}]
    for values in objects:
        if values:
            found = [{**one, **other} for one in found for other in values][:_MOST]
    yield from found


def _matches(pattern: str, name: str) -> bool:
    try:
        return re.search(pattern, name) is not None
    except re.error:
        return False


def _near(pattern: str) -> list[str]:
    """Return texts that a pattern may match: its letters, with something before and behind."""
    plain = re.sub(r"\\[dDwWsSbB]|\[[^\]]*\]|\{[^}]*\}|[\^$()?*+.|\\]", "", pattern)
    kinds = {r"\d": "7", r"\w": "b", "a-z": "q", "A-Z": "Q", "0-9": "7"}
    letters = "".join(text for kind, text in kinds.items() if kind in pattern)
    texts = [plain, f"{plain}{letters}", f"{letters}{plain}", *plain.split()[:2], *letters, plain[:1]]
    counts = [int(number) for number in re.findall(r"\d+", pattern)[:4] if int(number) < 100]  # noqa: PLR2004
    texts += [letter * count for letter in letters for count in counts]
    return [part for text in texts for part in (text, f"{text}x", f"x{text}", f"{text}7", f"{text} ", f"{text}X")]
