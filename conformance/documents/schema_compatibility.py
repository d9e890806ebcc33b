"""Compare two schemas of the same place: which changes break senders or readers that know the older one.

Which values are valid decides whether a change breaks (schema_containment). What changed is found word by word.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final

from conformance.documents.json_schema import Schema
from conformance.documents.schema_containment import Placed, apart, are_apart, is_covered, new_members, witness
from conformance.documents.schema_sides import (
    OPAQUE,
    UNSENT,
    Side,
    alternatives,
    are_related,
    common_types,
    is_same,
    kind_in,
    types_in,
)

# Keywords that are compared together, because one changes the meaning of the other.
_GROUPS: Final = (
    ("enum", "const"), ("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum"), ("multipleOf",),
    ("minLength",), ("maxLength",), ("pattern",), ("format",), ("minItems",), ("maxItems",), ("uniqueItems",),
    ("contains", "minContains", "maxContains"), ("minProperties",), ("maxProperties",), ("dependentRequired",),
    ("dependentSchemas",), ("propertyNames",), ("not",), ("if", "then", "else"),
)  # fmt: skip
_MEMBERS: Final = ("properties", "patternProperties", "additionalProperties")
# Keywords that depend on keywords elsewhere in the schema.
_WIDE: Final = ("unevaluatedProperties", "unevaluatedItems")


@dataclass(frozen=True)
class Finding:
    """A change in a schema.

    Attributes:
        breaks: whether it breaks a client; None if it is not known.
        text: what changed, following the name of the place.
        always: whether it is so whatever values are valid.
    """

    breaks: bool | None
    text: str
    always: bool = False


def schema_changes(old: tuple[Any, Side], new: tuple[Any, Side], *, request: bool) -> list[Finding]:
    """Return the changes between two schemas, and whether each breaks a client.

    A client of the older schema fails if what it sends is no longer taken, or if it reads what it did not expect.

    Args:
        old: prepared schema with its side.
        new: likewise.
        request: whether clients send the value; otherwise they read it.
    """
    return _Comparison(old[1], new[1], request).findings(old[0], new[0])


@dataclass
class _Comparison:
    """Compares schemas of two sides; a pair that contains itself is assumed to be right until it is not."""

    old: Side
    new: Side
    request: bool
    found: dict[str, list[Finding]] = field(default_factory=dict)
    open: dict[str, bool] = field(default_factory=dict)

    def findings(self, old: Any, new: Any) -> list[Finding]:
        before, after = self.old.target(old), self.new.target(new)
        key = json.dumps([before, after], sort_keys=True, default=str)
        if key in self.open:
            self.open[key] = True
            return []
        if key not in self.found:
            self.open[key] = False
            known = set(self.found)
            result = self._compare(before, after)
            if self.open.pop(key) and any(finding.breaks is not False for finding in result):
                # Discard results that assumed that this pair is compatible.
                for other in self.found.keys() - known:
                    del self.found[other]
            self.found[key] = result
        return self.found[key]

    def _is_covered(self, old: Any, new: Any, within: tuple[Any, Any] | None = None) -> bool:
        return is_covered(*self._placed_pair(old, new), self._new_members(*within or (old, new)))

    def _witness(self, old: Any, new: Any, within: tuple[Any, Any] | None = None) -> str | None:
        return witness(*self._placed_pair(old, new), self._new_members(*within or (old, new)))

    def _new_members(self, old: Any, new: Any) -> frozenset[str] | None:
        return new_members(*self._placed_pair(old, new)) if self.request else None

    def _placed_pair(self, old: Any, new: Any) -> tuple[Placed, Placed]:
        one, other = self._order((old, self.old), (new, self.new))
        return one, other

    def _order(self, old: Any, new: Any) -> tuple[Any, Any]:
        """Return the schema of the sent values, and that of the values that the receiver accepts."""
        return (old, new) if self.request else (new, old)

    def _compare(self, old: Any, new: Any) -> list[Finding]:
        if is_same(old, new, self.old, self.new, set()):
            return []
        before, after = alternatives(old, self.old), alternatives(new, self.new)
        if len(before) == len(after) == 1:
            found = list(self._by_word(before[0], after[0]))
        else:
            found = list(self._by_alternative(old, new, before, after))
        found = list(dict.fromkeys(found))
        if any(finding.breaks is not False for finding in found) and self._is_covered(old, new):
            # A change that breaks by one keyword may be compensated by another.
            kept = [
                replace(finding, breaks=finding.breaks and finding.always)
                for finding in found
                if finding.breaks is not None or finding.always
            ]
            return [finding if finding.always else replace(finding, breaks=False) for finding in kept]
        if any(finding.breaks for finding in found) or all(
            finding.breaks is False or finding.always for finding in found
        ):
            return found
        example = self._witness(old, new)
        if example is None:
            return found
        known = [finding for finding in found if finding.breaks is False or finding.always]
        return [Finding(breaks=True, text=f": {self._now()} {cut(example)}"), *known]

    def _now(self) -> str:
        return "no longer takes, for example," if self.request else "may now be, for example,"

    def _by_alternative(self, old: Any, new: Any, before: list[Any], after: list[Any]) -> Iterator[Finding]:
        """Yield changes where a value may have several shapes: each that is sent must be one that is taken."""
        sent, taken = self._order(before, after)
        whole, side = self._order(old, new)[1], self._order(self.old, self.new)[1]
        sender = self._order(old, new)[0]
        sure = (
            not _has(whole, "oneOf")
            or self._may_overlap(sender, taken)
            or are_apart([(other, side) for other in taken])
        )
        for item in sent:
            if len(sent) > 1:
                yield from self._lost_members(item, taken)
            # Compare each value that may be sent in this form with all values that are accepted.
            if self._is_covered(*self._order(item, whole)):
                continue
            like = [
                other for other in taken if kind_in(item) == kind_in(other) or "" in (kind_in(item), kind_in(other))
            ]
            found = [self.findings(*self._order(item, other)) for other in like]
            if sure and any(all(change.breaks is False for change in changes) for changes in found):
                continue
            example = self._witness(*self._order(item, whole))
            if example is None:
                yield Finding(None, f": not compared: {differing(old, new) or 'alternatives'}")
            elif len(found) == 1 and any(change.breaks for change in found[0]):
                yield from (change for change in found[0] if change.breaks)
            else:
                yield Finding(
                    breaks=True, text=f" may {'no longer' if self.request else 'now'} be {name_of(item, example)}"
                )
        for item in taken:
            if not any(kind_in(item) == kind_in(other) for other in sent):
                yield Finding(breaks=False, text=f" may {'now' if self.request else 'no longer'} be {name_of(item)}")

    def _may_overlap(self, sender: Any, taken: list[Any]) -> bool:
        """Return whether a client takes an object that fits several alternatives, as both schemas have oneOf."""
        return not self.request and _has(sender, "oneOf") and all(kind_in(item) == "object" for item in taken)

    def _lost_members(self, one: Any, taken: list[Any]) -> Iterator[Finding]:
        """Yield the members that are gone from the one shape that has values of a shape that is sent."""
        same = [other for other in taken if not apart(*self._placed_pair(*self._order(one, other)))]
        if len(same) == 1:
            yield from (change for change in self.findings(*self._order(one, same[0])) if change.always)

    def _by_word(self, old: Any, new: Any) -> Iterator[Finding]:
        """Yield the changes between two schemas without alternatives."""
        if isinstance(old, bool) or isinstance(new, bool):
            old, new = ({} if item is True else {"enum": []} if item is False else item for item in (old, new))
        kinds = types_in(old), types_in(new)
        if kinds[0] != kinds[1]:
            one, other = ({"type": list(kind)} if kind else True for kind in kinds)
            fine = self._is_covered(one, other)
            yield Finding(breaks=not fine, text=f": type {type_text(kinds[0])} → {type_text(kinds[1])}")
            if kinds[0] and kinds[1] and not are_related(*kinds):
                return
        for words in _GROUPS:
            yield from self._group(old, new, words)
        yield from self._members(old, new)
        yield from self._items(old, new)
        yield from self._parts(old, new)
        for word in ("anyOf", "oneOf", "$ref", *_WIDE):
            if not is_same(old.get(word), new.get(word), self.old, self.new, set()):
                yield Finding(None, f": not compared: {word}")
        for word in OPAQUE:
            if old.get(word) != new.get(word):
                yield Finding(None, f": not compared: {word}", always=True)

    def _parts(self, old: Schema, new: Schema) -> Iterator[Finding]:
        """Yield the changes of allOf's parts that could not be merged into one schema."""
        parts = old.get("allOf", []), new.get("allOf", [])
        if len(parts[0]) == len(parts[1]):
            for pair in zip(*parts, strict=True):
                yield from self.findings(*pair)
        else:
            yield Finding(None, ": not compared: allOf")

    def _group(self, old: Schema, new: Schema, words: tuple[str, ...]) -> Iterator[Finding]:
        before, after = ({word: item[word] for word in words if word in item} for item in (old, new))
        if is_same(before, after, self.old, self.new, set()):
            return
        one, other = (
            {**({"type": given["type"]} if "type" in given else {}), **part}
            for given, part in ((old, before), (new, after))
        )
        if one.get("type") != other.get("type"):
            # A changed type is reported as a change of its own.
            one, other = ({**shell, "type": common_types(old, new)} for shell in (one, other))
        within = old, new
        if self._is_covered(one, other, within):
            breaks: bool | None = False
            sent, taken = self._placed_pair(one, other)
            if is_covered(taken, sent, frozenset()):
                return
        elif self._witness(one, other, within) is not None or words == ("format",):
            breaks = True
        else:
            breaks = None
        for word in words:
            if before.get(word, before) != after.get(word, after):
                unknown = f": not compared: {word}"
                yield Finding(breaks, unknown if breaks is None else change_text(word, old, new, request=self.request))
                if word in {"enum", "const"}:
                    return

    def _members(self, old: Schema, new: Schema) -> Iterator[Finding]:
        """Yield changes of an object's members."""
        before, after = (
            {name: part for name, part in item.get("properties", {}).items() if part != UNSENT} for item in (old, new)
        )
        needed, needs = (frozenset(item.get("required", ())) for item in (old, new))
        for name in sorted(needed ^ needs):
            introduced = name not in before and name in after
            word = "new, and required" if introduced else "required now" if name in needs else "optional now"
            yield Finding(breaks=(name in needs) == self.request, text=f", member {name} is {word}")
        for name, schema in after.items():
            if name not in before:
                if name not in needs - needed:
                    yield Finding(breaks=False, text=f", member {name} is new")
                yield from self._against_others(old, name, schema, old_has=False)
        for name, schema in before.items():
            if name in after:
                yield from (
                    replace(finding, text=below(name, finding.text)) for finding in self.findings(schema, after[name])
                )
            elif schema is not False:
                yield Finding(breaks=True, text=f", member {name} is gone", always=True)
                yield from self._against_others(new, name, schema, old_has=True)
        yield from self._other_members(old, new)

    def _against_others(self, other: Schema, name: str, schema: Any, *, old_has: bool) -> Iterator[Finding]:
        """Yield changes of a member that only one schema names, while the other covers it by additionalProperties."""
        if any(word in other for word in ("patternProperties", *_WIDE)):
            yield Finding(None, f", member {name}: not compared: patternProperties")
        rest = True if name in other.get("properties", ()) else other.get("additionalProperties", True)
        sends = old_has == self.request
        if rest is True or (rest is False and not (sends and self.request)):
            # Clients send no undescribed members, and ignore those that they do not know.
            return
        pair = (schema, rest) if old_has else (rest, schema)
        yield from (replace(finding, text=below(name, finding.text)) for finding in self.findings(*pair))

    def _other_members(self, old: Schema, new: Schema) -> Iterator[Finding]:
        """Yield changes of the members that have no name of their own."""
        patterns = [item.get("patternProperties", {}) for item in (old, new)]
        if patterns[0].keys() == patterns[1].keys():
            for pattern, schema in patterns[0].items():
                found = self.findings(schema, patterns[1][pattern])
                yield from (replace(finding, text=below(pattern, finding.text)) for finding in found)
        else:
            one, other = ({word: given[word] for word in _MEMBERS if word in given} for given in (old, new))
            if not self._is_covered(one, other, (old, new)):
                shown = self._witness(one, other, (old, new)) is not None
                text = ": other members by patternProperties" if shown else ": not compared: patternProperties"
                yield Finding(breaks=shown or None, text=text)
        rest, others = (item.get("additionalProperties", True) for item in (old, new))
        if (rest is False) != (others is False):
            closes = others is False
            word = "refused" if closes else "allowed"
            yield Finding(breaks=self.request and closes, text=f": members that are not described are {word} now")
        elif not is_same(rest, others, self.old, self.new, set()):
            yield from (replace(finding, text=below("*", finding.text)) for finding in self.findings(rest, others))

    def _items(self, old: Schema, new: Schema) -> Iterator[Finding]:
        """Yield changes of the items: each of the first ones with its own schema, then the others."""
        first = [item.get("prefixItems", []) for item in (old, new)]
        rest = [item.get("items", True) for item in (old, new)]
        for number in range(max(map(len, first))):
            pair = [some[number] if number < len(some) else other for some, other in zip(first, rest, strict=True)]
            yield from (replace(finding, text=f"[{number}]{finding.text}") for finding in self.findings(*pair))
        yield from (replace(finding, text=f"[]{finding.text}") for finding in self.findings(*rest))


def _has(schema: Any, word: str) -> bool:
    return isinstance(schema, dict) and word in schema


_SIMPLE: Final = (str, int, float, list)
_EXAMPLE: Final = 80
_WITHOUT: Final = "none"


def name_of(schema: Any, example: str = "") -> str:
    """Return a shape's name: its values or its type, and a value if the type says little."""
    if not isinstance(schema, dict):
        return example or "anything"
    if "const" in schema or "enum" in schema:
        return _words(schema.get("enum", [schema.get("const")]))
    kind = str(schema.get("type") or "anything")
    return f"{kind}, for example {cut(example)}" if example and kind in {"object", "array"} else kind


def type_text(kinds: tuple[str, ...]) -> str:
    """Return types as text."""
    return " or ".join(kinds) or "any"


def differing(old: Any, new: Any) -> str:
    """Return the words whose values differ."""
    if not (isinstance(old, dict) and isinstance(new, dict)):
        return ""
    return ", ".join(sorted(key for key in old.keys() | new.keys() if old.get(key) != new.get(key)))


def change_text(word: str, old: Schema, new: Schema, *, request: bool) -> str:
    """Return the change of a word as text."""
    if word in {"enum", "const"}:
        return _values(old, new, request=request)
    before, after = old.get(word), new.get(word)
    if word == "uniqueItems":
        return f": items must {'' if after else 'not '}differ"
    if all(item is None or isinstance(item, _SIMPLE) for item in (before, after)):
        return f": {word} {_words(before)} → {_words(after)}"
    return f": {word} is {'new' if before is None else 'gone' if after is None else 'another'}"


def _values(old: Schema, new: Schema, *, request: bool) -> str:
    before, after = (item.get("enum", [item["const"]] if "const" in item else None) for item in (old, new))
    if [] in (before, after):
        # the schema `false`
        return f": {'no value is' if after == [] else 'values are'} allowed now"
    if before is None or after is None:
        return f": values {_words(before)} → {_words(after)}"
    fewer = [item for item in before if item not in after]
    more = [item for item in after if item not in before]
    # Breaking changes come first.
    texts = [f"may no longer be {_words(fewer)}" if fewer else "", f"may now be {_words(more)}" if more else ""]
    return " " + ", and ".join(text for text in (texts if request else texts[::-1]) if text)


def below(name: str, text: str) -> str:
    """Return a member's change: its name before that of the changed inner member."""
    if text.startswith(", member "):
        return f", member {name}.{text.removeprefix(', member ')}"
    return f", member {name}{text}"


def _words(value: Any) -> str:
    if value is None:
        return _WITHOUT
    values = value if isinstance(value, list) else [value]
    return ", ".join(one if isinstance(one, str) else json.dumps(one) for one in values) or _WITHOUT


def cut(text: str) -> str:
    """Return an example that is not too long to be read."""
    return text if len(text) <= _EXAMPLE else f"{text[:_EXAMPLE]}…"
