"""Find schemas that no validator can use, because they unroll to more parts than memory holds.

Ten references of each schema to the next, over ten schemas, are a file of a few kilobytes, and ten billion parts.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, Final

from conformance.documents.json_schema import Schema, UnresolvedError, target_of

# Most schemas that may apply to one value, by allOf, anyOf, oneOf, not, if, then, else and references.
_MOST_AT_ONCE: Final = 5_000
# Largest value that a schema may demand: members, items and characters.
_LARGEST: Final = 1_000_000
# Most values of these keywords: each value is sent in a request of its own.
_MOST_VALUES: Final = {"enum": 50_000, "examples": 10_000}
_DEEPEST: Final = 60  # references in a chain
_MOST_STEPS: Final = 50_000  # how often schemas are visited again
_LONGEST_PATTERN: Final = 20_000  # characters of a pattern
_MOST_REPEATS: Final = 10_000  # product of nested quantifiers
_MOST_STATES: Final = 3_000_000  # states of all patterns of a document (50 bytes each in an automaton)
_STATES_OF_ONE: Final = 200_000  # states of one pattern
_PART: Final = re.compile(r"\\.|\[(?:\\.|[^\]\\])*\]|\{(\d{1,9})(?:,(\d{0,9}))?\}|.", re.DOTALL)
_SCHEMAS: Final = frozenset({"schema", "schemas", "definitions", "example", "value"})
_SHOWN: Final = 60
# Most entries of these objects and lists in an operation, outside of schemas.
_CROWDS: Final = {
    "paths": 10_000, "parameters": 1_000, "responses": 1_000, "content": 1_000, "headers": 1_000, "callbacks": 1_000,
    "links": 1_000, "security": 1_000, "servers": 1_000, "encoding": 1_000, "examples": 10_000,
    "securitySchemes": 1_000,
}  # fmt: skip
_LONGEST_WORD: Final = 100_000  # characters of a name, address or pattern
_FOR_PEOPLE: Final = frozenset({"description", "summary", "title", "$comment"})  # keywords without this limit
_VALUES: Final = frozenset({"example", "examples", "default", "value", "enum", "const", "pattern"})
_IN_ADDRESSES: Final = frozenset({"parameters", "servers", "headers"})
# Budget of generators that follow every reference: _MOST_UNROLLED parts, _MOST_BESIDE references deep. They make cases
# of each part with all others, so time grows with the square. GitHub's largest operation has 900 parts.
_MOST_UNROLLED: Final = 10_000
_MOST_BESIDE: Final = 1_000
_UNROLLED_DEEPEST: Final = 8
_SEVERAL: Final = ("allOf", "anyOf", "oneOf")
_ONE: Final = ("not", "if", "then", "else")

# Function that yields the schemas that apply together with a schema.
Parts = Callable[[Schema], Iterator[Any]]


class Growth:
    """Judges the schemas of one document; a schema beyond the budget counts as 1 in those that refer to it."""

    def __init__(self, document: Schema) -> None:
        self._document = document
        self._weights: dict[int, int] = {}
        self._sizes: dict[int, int] = {}
        self._patterns: dict[str, str] = {}
        self._states = 0
        self._seen: set[int] = set()
        self._steps = 0
        self._kept: list[Any] = []  # keep each schema alive, because its id() stands for it

    def fault(self, schema: Any) -> str:
        """Return why nothing can be judged by a schema; empty if it can. Ask for inner schemas first."""
        if not isinstance(schema, dict):
            return ""
        self._kept.append(schema)
        if self._weight(schema, [])[0] > _MOST_AT_ONCE:
            self._weights[id(schema)] = 1
            return f"more than {_MOST_AT_ONCE:,} schemas bind one value, by allOf, anyOf, oneOf and references"
        if self._size(schema, [])[0] > _LARGEST:
            self._sizes[id(schema)] = 1
            return f"its smallest value has more than {_LARGEST:,} parts"
        for word, most in _MOST_VALUES.items():
            if (count := len(_list(schema, word))) > most:
                return f"{word} of {count:,} values; the limit is {most:,}"
        sent = [*_list(schema, "enum"), schema.get("const"), schema.get("default")]
        if (longest := max(map(_characters, sent), default=0)) > _LARGEST:
            return f"a value of {longest:,} characters in enum, const or default; the limit is {_LARGEST:,}"
        names = schema.get("patternProperties")
        patterns = [schema.get("pattern"), *(names if isinstance(names, dict) else ())]
        return next(
            filter(None, (self._pattern_fault(pattern) for pattern in patterns if isinstance(pattern, str))), ""
        )

    def _pattern_fault(self, pattern: str) -> str:
        if pattern not in self._patterns:
            states, repeats = _unrolled_size(pattern) if len(pattern) <= _LONGEST_PATTERN else (0, 0)
            self._states += min(states, _STATES_OF_ONE)
            fault = f"a pattern of {len(pattern):,} characters" if len(pattern) > _LONGEST_PATTERN else ""
            if repeats > _MOST_REPEATS:
                fault = f"the nested quantifiers of a pattern repeat more than {_MOST_REPEATS:,} times"
            if self._states > _MOST_STATES:
                fault = f"the patterns of the document have more than {_MOST_STATES:,} parts"
            self._patterns[pattern] = fault
        return self._patterns[pattern]

    def _target(self, schema: Schema) -> Any:
        """Return the target of a schema's reference, or None."""
        try:
            return target_of(self._document, schema["$ref"]) if isinstance(schema.get("$ref"), str) else None
        except UnresolvedError:
            return None

    def _weight(self, schema: Any, trail: list[int]) -> tuple[int, int]:
        """Return how many schemas bind a value of a schema, and how far up the trail the schema refers, if it does."""
        return self._sum(schema, trail, self._weights, _MOST_AT_ONCE, self._weight_of)

    def _size(self, schema: Any, trail: list[int]) -> tuple[int, int]:
        """Return how many parts the smallest value of a schema has, likewise."""
        return self._sum(schema, trail, self._sizes, _LARGEST, self._size_of)

    def _sum(
        self,
        schema: Any,
        trail: list[int],
        known: dict[int, int],
        most: int,
        count: Callable[[Schema, list[int], list[int]], int],
    ) -> tuple[int, int]:
        if not isinstance(schema, dict):
            return 1, len(trail)
        if (found := known.get(id(schema))) is not None:
            return found, len(trail)
        if id(schema) in trail:
            return 1, trail.index(id(schema))
        self._steps += id(schema) in self._seen
        self._seen.add(id(schema))
        if len(trail) > _DEEPEST or self._steps > _MOST_STEPS:
            return most + 1, len(trail)
        lows = [len(trail)]
        trail.append(id(schema))
        total = count(schema, trail, lows)
        trail.pop()
        low = min(lows)
        # A sum without the schemas on the trail holds for this trail only.
        if low >= len(trail):
            known[id(schema)] = total
        return total, low

    def _weight_of(self, schema: Schema, trail: list[int], lows: list[int]) -> int:
        total = 1
        for part in self._at_once(schema):
            weight, low = self._weight(part, trail)
            lows.append(low)
            total += weight
            if total > _MOST_AT_ONCE:
                break
        return total

    def _at_once(self, schema: Schema) -> Iterator[Any]:
        if (target := self._target(schema)) is not None:
            yield target
        for key in _SEVERAL:
            yield from schema[key] if isinstance(schema.get(key), list) else ()
        yield from (schema[key] for key in _ONE if key in schema)
        dependent = schema.get("dependentSchemas")
        yield from dependent.values() if isinstance(dependent, dict) else ()

    def _size_of(self, schema: Schema, trail: list[int], lows: list[int]) -> int:
        def size(part: Any) -> int:
            found, low = self._size(part, trail)
            lows.append(low)
            return found

        sizes = [1, _number(schema, "minLength"), _number(schema, "minProperties")]
        if least := _number(schema, "minItems"):
            sizes.append(least * size(schema.get("items")))
        required, properties = schema.get("required"), schema.get("properties")
        if isinstance(required, list):
            members = properties if isinstance(properties, dict) else {}
            total = 1
            for name in required:
                total += size(members.get(name) if isinstance(name, str) else None)
                if total > _LARGEST:
                    break
            sizes.append(total)
        if (target := self._target(schema)) is not None:
            sizes.append(size(target))
        sizes += [size(part) for part in _list(schema, "allOf")]
        for key in ("anyOf", "oneOf"):
            if parts := _list(schema, key):
                sizes.append(min(map(size, parts)))
        return max(sizes)


def _number(schema: Schema, word: str) -> int:
    found = schema.get(word)
    return int(found) if isinstance(found, int | float) and found > 0 else 0


def _characters(value: Any) -> int:
    """Return how many characters the texts in a value have, up to a little more than the limit."""
    waiting, total = [value], 0
    while waiting and total <= _LARGEST:
        part = waiting.pop()
        total += len(part) if isinstance(part, str) else 1
        waiting += part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    return total


def _list(schema: Schema, word: str) -> list[Any]:
    found = schema.get(word)
    return found if isinstance(found, list) else []


def _unrolled_size(pattern: str) -> tuple[int, int]:
    """Return how many states a pattern has with its quantifiers unrolled, and how often nested ones repeat."""
    # For each open group, its parts: their states, repeats, and depth of nested quantifiers.
    groups: list[list[tuple[int, int, int]]] = [[]]
    nested = 1
    for found in _PART.finditer(pattern):
        if found[0] == "(":
            groups.append([])
        elif found[0] == ")" and len(groups) > 1:
            inner = groups.pop() or [(1, 1, 0)]
            groups[-1].append((sum(one[0] for one in inner), *max(one[1:] for one in inner)))
        elif found[1] and groups[-1] and (times := int(found[2] or found[1])) > 1:
            states, repeats, depth = groups[-1].pop()
            repeats = min(repeats * times, 10**9)
            nested = max(nested, repeats if depth else 1)
            groups[-1].append((min(states * times, 10**9), repeats, depth + 1))
        else:
            groups[-1].append((1, 1, 0))
    return sum(one[0] for group in groups for one in group), nested


def crowd_in(document: Schema) -> str:
    """Return the place of a list or object with too many members; empty if there is none."""
    waiting: list[tuple[Any, str]] = [(document, "#")]
    while waiting:
        value, place = waiting.pop()
        for name, part in value.items() if isinstance(value, dict) else enumerate(value):
            if not isinstance(part, dict | list) or name in _SCHEMAS:
                continue
            most = _CROWDS.get(str(name))
            if most is not None and len(part) > most:
                return f"{place}/{name} has {len(part):,} members; the limit is {most:,}"
            waiting.append((part, f"{place}/{str(name)[:_SHOWN]}"))
    return ""


def long_text_in(document: Schema) -> str:
    """Return the place of a text that is too long for a name, address or pattern; empty if there is none.

    Only texts for people, extensions and values of bodies may be longer; values of parameters and servers may not.
    """
    waiting: list[tuple[Any, str, bool]] = [(document, "#", False)]
    while waiting:
        value, place, is_short = waiting.pop()
        for name, part in value.items() if isinstance(value, dict) else enumerate(value):
            word = str(name)[:_SHOWN]
            if word.startswith("x-") or (word in _VALUES and not is_short):
                continue
            if isinstance(part, dict | list):
                waiting.append((part, f"{place}/{word}", is_short or word in _IN_ADDRESSES))
            elif isinstance(part, str) and len(part) > _LONGEST_WORD and word not in _FOR_PEOPLE:
                return f"{place}/{word} has {len(part):,} characters; the limit is {_LONGEST_WORD:,}"
    return ""


def unrolls(document: Schema, value: Any) -> bool:
    """Return whether a part of a document has more parts than a generator can walk through, references followed."""
    waiting, seen = [(value, 0)], 0
    while waiting and seen <= _MOST_UNROLLED:
        part, depth = waiting.pop()
        seen += 1
        if isinstance(part, dict) and isinstance(part.get("$ref"), str) and depth < _UNROLLED_DEEPEST:
            try:
                waiting.append((target_of(document, part["$ref"]), depth + 1))
            except UnresolvedError:
                continue
        inner = part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
        beside = [(item, depth) for item in inner if isinstance(item, dict | list)]
        if len(beside) > _MOST_BESIDE:
            return True
        waiting += beside
    return seen > _MOST_UNROLLED
