"""Bodies that show the effect of a write: with missing members, null, one wrong member, and patches."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from itertools import islice, product
from typing import Any, Final

from conformance.api.rest.inputs import Inputs, usual_inputs
from conformance.api.rest.invalid_variations import invalid_variations
from conformance.api.rest.patches import JSON_PATCH, MERGE, PatchError, patched, same
from conformance.api.rest.references import is_free_text
from conformance.api.rest.samples import TEXTS, alike_and_apart, entry_of, fits, sample
from conformance.api.rest.things import another, is_devices, parts_of, says_exactly
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind
from conformance.checkers.writes import GONE
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.scenarios.singletons import is_harmless

_LINES: Final = "roaas\r\n\r\n two\nend"  # lines with both kinds of line ends
# Names of members whose text may have several lines.
_LONG: Final = re.compile(r"note|description|comment|text|remark|message|memo|instruction|detail|body|content|reason")
_PARTS: Final = (0.375, 0.5, 0.25, 0.1)  # fractions, several for each member
_ALL_DIGITS: Final = 0.12345678901234  # a number that needs all digits of a double
_BEYOND_DOUBLES: Final = 2**53 + 1  # an integer that is no double
_KEYS: Final = ("roaas-one", "roaas-two", "roaas-three")  # keys of entries that are added to a map
_LONGEST: Final = 300  # longest text that is sent, characters
_NULLS: Final = 2  # members that a patch removes by null, where that is allowed
_TIME, _FINER = "2026-02-{:02}T12:34:56+05:30", ".625-03:30"


def special_bodies(
    change: Operation, read: Operation, now: Callable[[], dict[str, Any]], values: Values, may: Callable[[str], bool]
) -> Iterator[Any]:
    """Yield bodies for writes that are each followed by a read; the last one restores the first values.

    They change members for whose names ``may`` holds; ``now`` returns those that were last read.
    """
    usual, first = usual_inputs(change, values)[0], now()
    schema = change.bodies[usual.media_type].schema
    if JSON_PATCH in usual.media_type:
        yield from _patches(schema, read, now, values, may)
        return
    if not isinstance(usual.body, dict):
        return
    if owned := with_owned(change, read, {} if change.method == "PATCH" else usual.body):
        yield owned
    parts = _sent_parts(schema)
    there = {name: one for name, one in first.items() if name in parts and not parts[name].get("readOnly")}
    there = {name: one for name, one in there.items() if fits(parts[name], one)}
    changed = {name: one for name, one in telling(schema, there, 1, values.collections).items() if may(name)}
    if change.method == "PUT":
        base = {**usual.body, **there}
        yield from half_valid(change, usual, {**base, **changed})
        # If the description says that omitted members go, the device has no default for them.
        needed = flat(read.shape or {}).get("required", ()) if GONE.search(change.text) else None
        yield from _replacing(schema, base, changed, values, may, needed)
        return
    yield from [{}] if fits(schema, {}) else []
    if MERGE in usual.media_type:
        yield from _nulls(parts, read, now, values, may)
    else:
        shown = parts_of(read.shape or {})
        needed = [name for name in flat(read.shape or {}).get("required", ()) if not fits(shown.get(name, {}), None)]
        nulls = [name for name in there if name not in needed and there[name] is not None and may(name)]
        yield from ({name: None} for name in nulls[:_NULLS] if fits(parts[name], None))
    # Requests to be refused come first: a value that is already there would show nothing.
    yield from half_valid(change, usual, changed)
    # All together, and what has a time zone alone: the device may have a reason to refuse another one.
    zoned = [
        {name: one.replace("+05:30", _FINER)}
        for name, one in changed.items()
        if flat(parts[name]).get("format") == "date-time"
    ]
    zoned += _in_lines(changed, parts)
    rich = {name: one for name, one in _rich(parts, there, values.collections).items() if may(name)}
    empty: dict[str, Any] = {name: [] for name in rich.keys() | changed.keys() if isinstance(there[name], list)}
    # Programs take 0, false and an empty text for nothing: twice, as a device may not take one at the moment.
    scalars = {name: type(changed[name])() for name in changed if isinstance(changed[name], str | int | float)}
    zeros = {name: one for name, one in scalars.items() if fits(parts[name], one)}
    bodies = (changed, *zoned, rich, {**empty, **zeros}, zeros)
    yield from (item for item in bodies if item and fits(schema, item))
    restored = {name: one for name, one in there.items() if now().get(name) != one}
    if restored and fits(schema, restored):
        yield restored


def _sent_parts(schema: Schema) -> dict[str, Any]:
    """Return the members of a body as it is sent: an object around all others is one of them."""
    parts: dict[str, Any] = flat(schema).get("properties", {})
    return parts


def _rich(parts: dict[str, Any], there: dict[str, Any], collections: frozenset[str]) -> dict[str, Any]:
    """Return new entries for each map, and two different items for each list of objects."""
    found: dict[str, Any] = {}
    for name, one in there.items():
        given = flat(parts[name])
        inner = given.get("items") if isinstance(one, list) else entry_of(given)
        of = flat(inner) if isinstance(inner, dict) else {}
        if not of or (isinstance(one, list) and "properties" not in of) or is_devices(name, given, collections):
            continue
        wrapped: Schema = {"properties": dict.fromkeys(_KEYS[:2], of)}
        made = telling(wrapped, {key: sample(of, 1, whole=True) for key in _KEYS[:2]}, 1, collections)
        made[_KEYS[1]] = telling(wrapped, made, 2, collections)[_KEYS[1]]
        owned = [key for key, part in of.get("properties", {}).items() if is_devices(key, part, collections)]
        value = list(made.values()) if isinstance(one, list) else made
        if not owned and made[_KEYS[0]] != made[_KEYS[1]] and fits(given, value):
            found[name] = value
    return found


def by_format(change: Operation) -> list[Operation]:
    """Return a write with each of its JSON formats alone; the first one, whatever it is, comes first."""
    own = [(name, body) for place, (name, body) in enumerate(change.bodies.items()) if not place or is_json(name)]
    return [replace(change, bodies={name: body}) for name, body in own]


def _in_lines(changed: dict[str, Any], parts: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a text of several lines for the member that probably has some, else for the last text."""
    texts = [name for name, one in changed.items() if isinstance(one, str) and is_free_text(parts[name])]
    longer = [name for name in texts if _LONG.search(plain_name(name))]
    # A text that is kept exactly has blanks at its ends too.
    lines = [{name: f" {_LINES} " if says_exactly(parts[name]) else _LINES} for name in (longer or texts)[-1:]]
    within = (
        (name, one, _in_lines(one, _sent_parts(parts[name]))) for name, one in changed.items() if isinstance(one, dict)
    )
    return lines + [{name: {**one, **text}} for name, one, inner in within for text in inner][:1]


def _empty_values(parts: dict[str, Any], body: dict[str, Any]) -> dict[str, Any]:
    """Return empty lists and maps, null, and objects without their optional members, as far as they are allowed."""
    found: dict[str, Any] = {}
    for name, one in body.items():
        given = flat(parts.get(name, {}))
        inner = {key: one[key] for key in one if key in given.get("required", ())} if isinstance(one, dict) else one
        inner = {**inner, **_empty_values(given.get("properties", {}), inner)} if isinstance(one, dict) else one
        candidates: tuple[Any, ...] = (None, [], {}, inner)
        empty = next((new for new in candidates if fits(given, new)), one)
        if empty != one and not is_devices(name, given, frozenset()):
            found[name] = empty
    return found


def _replacing(
    schema: Schema,
    base: dict[str, Any],
    changed: dict[str, Any],
    values: Values,
    may: Callable[[str], bool],
    needed: Collection[str] | None,
) -> Iterator[dict[str, Any]]:
    """Yield bodies of PUT with other values of all members, with the required members alone, and as it was before."""
    if fits(schema, {**base, **changed}):
        parts = _sent_parts(schema)
        whole = {**base, **changed}
        rich = {**whole, **_rich(parts, whole, values.collections)}
        lines = [{**whole, **one} for one in _in_lines(changed, parts)]
        # One fraction that is lost does not show whether the device has steps.
        parted = [name for name, one in whole.items() if isinstance(one, float) and not one.is_integer()]
        second = telling(schema, whole, 2, values.collections) if parted else {}
        lines += [{**whole, **{name: second[name] for name in parted if may(name)}}] if parted else []
        less = {**rich, **{name: one for name, one in _empty_values(parts, rich).items() if may(name)}}
        yield from (whole, *(one for one in (rich, less, *lines) if one != whole and fits(schema, one)))
        least = {name: base[name] for name in base if name in flat(schema).get("required", ())}
        other = telling(schema, least, 2, values.collections)
        least |= {name: one for name, one in other.items() if may(name)}
        left_out = [flat(one) for name, one in parts.items() if name not in least]
        goes = needed is not None and any(name not in least and name not in needed for name in base)
        if (goes or any("default" in item for item in left_out)) and fits(schema, least):
            yield least
    if fits(schema, base):
        yield base


def half_valid(change: Operation, usual: Inputs, valid: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield valid bodies with one value that the description forbids: of the last member, and of the first."""
    names = list(flat(change.bodies[usual.media_type].schema).get("properties", {}))
    ordered = {name: valid[name] for name in sorted(valid, key=lambda text: names.index(text) if text in names else 0)}
    by_place: dict[str, Any] = {}
    for variation in invalid_variations(change, replace(usual, body=ordered)):
        if variation.kind is Kind.INVALID and isinstance(variation.inputs.body, dict):
            by_place.setdefault(variation.place, variation.inputs.body)
    wrong = [by_place[f"body /{name}"] for name in ordered if f"body /{name}" in by_place]
    yield from {id(item): item for item in (wrong[-1:] + wrong[:1])}.values()


def telling(schema: Schema, body: dict[str, Any], turn: int, collections: frozenset[str]) -> dict[str, Any]:
    """Return other values for a body's members by which losses show: fractions, order, time zones."""
    parts, found = _sent_parts(schema), another(schema, body, turn, collections)
    for name in found:
        given = flat(parts.get(name, {}))
        if is_devices(name, given, collections):
            continue
        if isinstance(body[name], dict):
            found[name] = telling(given, body[name], turn, collections)
            continue
        usable = (item for item in _telling(given, found[name], turn) if item != body[name] and fits(given, item))
        value = next(usable, found[name])
        found[name] = value if fits(schema, {**found, name: value}) else found[name]
    return found


def _telling(schema: Schema, value: Any, turn: int) -> Iterator[Any]:
    kinds = kinds_of(schema)
    if is_number(value) and "number" in kinds:
        if schema.get("format") == "double":
            yield from (int(value) + turn * _ALL_DIGITS, int(value) - turn * _ALL_DIGITS)
        for part in (*_PARTS[turn % len(_PARTS) :], *_PARTS):
            yield from (int(value) + part, int(value) - part)
    elif is_number(value) and (schema.get("format") == "int64" or schema.get("maximum", 0) >= _BEYOND_DOUBLES):
        yield from (-_BEYOND_DOUBLES, _BEYOND_DOUBLES)
    elif isinstance(value, list):
        apart = alike_and_apart(schema)[1][::-1]
        # Capital letters, and an order that is not that of the alphabet.
        cased = [one.title() if isinstance(one, str) else one for one in apart[:1]]
        yield from ([*cased, *apart[1:], *apart[:1]], [*apart, *apart[:1]], apart)
    elif schema.get("format") == "date-time":
        yield _TIME.format(turn)
    elif isinstance(value, str) and is_free_text(schema):
        # The longest allowed text: a device may cut it, or count bytes.
        most = min(schema.get("maxLength", 0), _LONGEST)
        yield from (*(f"{(text * most)[: most - 1]}Z" for text in TEXTS[:1] if most > len("007 ")), *TEXTS)


def _nulls(
    parts: Schema, read: Operation, now: Callable[[], dict[str, Any]], values: Values, may: Callable[[str], bool]
) -> Iterator[dict[str, Any]]:
    """Yield merge patches that remove a member and change another one, and one that changes a part of an object."""
    needed, removable = flat(read.shape or {}).get("required", ()), _removable(parts, read)
    own = {name for name, part in parts.items() if is_devices(name, part, frozenset())} - removable
    absent = [name for name in parts if now().get(name) is None and name not in own]
    filled = {name: sample(parts[name], 1) for name in absent if may(name) or name in removable}
    filled = {name: one for name, one in filled.items() if one and fits(parts[name], one)}
    yield from [filled] if filled else []
    there = now()
    usable = {name: one for name, one in there.items() if name in parts and one is not None}
    usable = {name: one for name, one in usable.items() if may(name) or name in removable}
    nulls = [name for name in usable if name not in own and (name not in needed or fits(parts[name], None))]
    together = [name for name in nulls if fits(parts[name], None)]
    for turn, names in enumerate([together, *([name] for name in nulls[:_NULLS])]):
        gone = [name for name in names if now().get(name) is not None]
        rest = {one: value for one, value in usable.items() if one not in nulls and one not in own}
        others = another({"properties": parts}, rest, turn + 3, values.collections)
        beside = next((other for other in others if others[other] not in (None, now().get(other))), None)
        if gone:
            yield {**dict.fromkeys(gone), **({beside: others[beside]} if beside else {})}
    changed = telling({"properties": parts}, {name: usable[name] for name in usable if name not in own}, 1, frozenset())
    for name in [text for text in changed if isinstance(changed[text], list) and changed[text] != usable[text]][:1]:
        yield from ({name: usable[name]}, {name: changed[name]})
    for name, given in ((text, entry_of(parts[text])) for text in usable if text not in own):
        # Add two entries to a map; remove one of them beside another new one; then remove all.
        entry = sample(given) if given is not None else None
        if entry is not None and fits(parts[name], dict.fromkeys(_KEYS, entry)):
            yield {name: dict.fromkeys(_KEYS[:2], entry)}
            yield {name: {_KEYS[0]: None, _KEYS[2]: entry}}
            yield {name: dict.fromkeys(_KEYS)}
            break
    for name, value in changed.items():
        inner = [item for item in value if value[item] != usable[name].get(item)] if isinstance(value, dict) else []
        if inner and len(value) > 1:
            # Each member alone: the others must keep the value of the patch before.
            for one in inner[:2]:
                if now().get(name) != value:
                    yield {name: value}
                yield {name: {one: value[one]}}
            yield {name: {inner[0]: usable[name].get(inner[0])}}
            yield from _null_within(parts[name], name, now().get(name) or {}, {one: value[one] for one in inner})
            break


def _null_within(
    given: Schema, name: str, held: dict[str, Any], others: dict[str, Any]
) -> Iterator[dict[str, dict[str, Any]]]:
    """Yield a merge patch that removes a member of an object and changes another one, by which a device shows that."""
    within = parts_of(given)
    free = (one for one in sorted(held.keys() & within.keys()) if held[one] is not None and fits(within[one], None))
    for gone in islice(free, 1):
        beside = [one for one in others if one != gone and others[one] != held.get(one)]
        yield from ({name: {gone: None, one: others[one]}} for one in beside[:1])


def _removable(parts: Schema, read: Operation) -> frozenset[str]:
    """Return members that clients may remove although their names sound like the device's.

    A schema for patches alone says so if it allows null for them.
    """
    if parts == parts_of(read.shape) or "id" in parts:
        return frozenset()
    marks = {"readOnly", "writeOnly", "const"}
    return frozenset(
        name for name, one in parts.items() if is_harmless(name) and fits(one, None) and not marks & flat(one).keys()
    )


def _patches(
    schema: Schema, read: Operation, now: Callable[[], dict[str, Any]], values: Values, may: Callable[[str], bool]
) -> Iterator[list[dict[str, Any]]]:
    """Yield JSON patches: right ones, and ones whose first or last operation fails."""
    parts = parts_of(read.shape or {})
    first = {name: one for name, one in now().items() if name in parts and may(name)}
    first = {name: one for name, one in first.items() if not is_devices(name, parts[name], values.collections)}

    def replacing(name: str, turn: int) -> dict[str, Any]:
        other = telling({"properties": {name: parts[name]}}, {name: now().get(name)}, turn, values.collections)
        return {"op": "replace", "path": _pointer(name), "value": other[name]}

    def testing(name: str, value: Any) -> dict[str, Any]:
        return {"op": "test", "path": _pointer(name), "value": value}

    names = [
        name for name in first if replacing(name, 1)["value"] != first[name] and fits(schema, [replacing(name, 1)])
    ]
    if not names:
        return
    one, last = names[0], names[-1]
    makers: list[Callable[[], list[dict[str, Any]]]] = [
        lambda: [testing(one, now().get(one)), replacing(one, 1)],
        lambda: [testing(last, "roaas"), replacing(one, 2)],
        lambda: [replacing(one, 2), testing(last, replacing(last, 3)["value"])] if one != last else [],
        lambda: [replacing(last, 1), {"op": "remove", "path": "/roaas-unknown"}],
        lambda: [{"op": "copy", "from": _pointer(one), "path": _pointer(last)}] if one != last else [],
    ]
    for name in (one for one, part in parts.items() if may(one) and "array" in kinds_of(part)):
        apart = alike_and_apart(parts[name])[1] or [None]
        # A value that is already there would show nothing.
        *rest, last_item = apart[::-1] if same(first.get(name), apart) else apart
        whole = {"op": "add", "path": _pointer(name), "value": rest}
        added = {"op": "add", "path": f"{_pointer(name)}/-", "value": last_item}
        if rest and fits(parts[name], [*rest, last_item]) and not flat(parts[name]).get("readOnly"):
            makers.append(lambda whole=whole, added=added: [whole, added])  # type: ignore[misc] # bound in its round
            break
    makers += [
        lambda: [testing(*unequal), replacing(one, 2)] if (unequal := _reversed_list(now())) else [],
        lambda: [{"op": "move", **moved} for moved in _moves(read, now(), may)][:1],
        lambda: [{"op": "remove", "path": _pointer(name)} for name in _optional(read, now(), may)][:1],
    ]
    for make in makers:
        if (patch := make()) and fits(schema, patch):
            yield patch
    if fits(schema, []):
        yield []
    there = now()
    restored = [
        {"op": "replace" if name in there else "add", "path": _pointer(name), "value": value}
        for name, value in first.items()
        if there.get(name) != value
    ]
    restored = [item for item in restored if fits(schema, [item])]
    if restored:
        yield restored


def _optional(read: Operation, there: dict[str, Any], may: Callable[[str], bool]) -> list[str]:
    """Return the members of a thing that may be removed from it."""
    parts, needed = parts_of(read.shape or {}), flat(read.shape or {}).get("required", ())
    free = [name for name in there if name in parts and name not in needed and may(name)]
    return [
        name for name in free if not (flat(parts[name]).get("readOnly") or is_devices(name, parts[name], frozenset()))
    ]


def _moves(read: Operation, there: dict[str, Any], may: Callable[[str], bool]) -> Iterator[dict[str, str]]:
    """Yield from where to where a value of a thing may be moved: an optional one, or the first item of a list."""
    parts = parts_of(read.shape or {})
    free = {name: there[name] for name in _optional(read, there, may)}
    lists = {name: one for name, one in there.items() if isinstance(one, list) and one and may(name)}
    sources = [(name, _pointer(name), one) for name, one in free.items()]
    sources += [
        (name, f"{_pointer(name)}/0", one[0])
        for name, one in lists.items()
        if name in parts and fits(parts[name], one[1:]) and not flat(parts[name]).get("readOnly")
    ]
    for (name, pointer, value), target in product(sources, parts):
        is_usable = target != name and may(target) and not is_devices(target, parts[target], frozenset())
        if is_usable and not flat(parts[target]).get("readOnly") and fits(parts[target], value):
            yield {"from": pointer, "path": _pointer(target)}


def _reversed_list(there: dict[str, Any]) -> tuple[str, Any] | None:
    """Return a list of a thing with its items in the opposite order, which is another list (RFC 6902 4.6)."""
    lists = ((name, one[::-1]) for name, one in there.items() if isinstance(one, list) and one != one[::-1])
    return next(lists, None)


def is_list_of_changes(document: Any, patch: Any) -> bool:
    """Return whether a JSON patch makes another document of this one."""
    try:
        return isinstance(patch, list) and not same(patched(document, patch), document)
    except PatchError:
        return False


def _pointer(name: str) -> str:
    return "/" + name.replace("~", "~0").replace("/", "~1")


def with_owned(change: Operation, read: Operation, body: Any) -> dict[str, Any] | None:
    """Return a body with values for members that the device sets; None if the schemas forbid that."""
    media_type = next(iter(change.bodies), "")
    if not isinstance(body, dict):
        return None
    schema = change.bodies[media_type].schema
    shown = {**flat(schema).get("properties", {}), **parts_of(read.shape or {})}
    own = {name: _own_value(one) for name, one in shown.items() if isinstance(one, dict) and flat(one).get("readOnly")}
    identifying = {plain_name(parameter.name) for parameter in read.parameter("path")} | {"id"}
    own = {name: one for name, one in own.items() if one is not None and plain_name(name) not in identifying}
    changed = {**body, **own}
    return changed if own and fits(schema, changed) else None


def _own_value(schema: Schema) -> Any:
    """Return a value that a device hardly chooses itself; None if the schema has few values."""
    given = flat(schema)
    candidates: tuple[Any, ...] = ("2001-02-03T04:05:06Z", "2001-02-03", "roaas-own", 987_653, 98_765.25)
    return None if "enum" in given else next((candidate for candidate in candidates if fits(schema, candidate)), None)
