"""How a schema has the fields of a ROS message: by their names, however they are written, and their types."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any, Final, cast

from conformance.documents.json_schema import Schema, kinds_of
from conformance.engine.commanded import parts_of
from conformance.scenarios.ros.definition import FLOATS, INTEGERS, LONG, Definition, Shape

# Limits for a schema: fields, levels and objects.
_LEAVES: Final = 500
_DEPTH: Final = 8
_PLACES: Final = 50
#: A message type with fewer fields cannot be recognised by its fields.
FEW: Final = 4
# The group of values that a letter before an axis stands for, as in qw and vx.
_LETTERS: Final = {"": "position", "q": "orientation", "v": "linear", "w": "angular"}
_AXIS: Final = re.compile(r"([qvw]?)([xyzw])")


@dataclass(frozen=True)
class Fit:
    """How a schema has the fields of a message.

    Attributes:
        at: where the message is.
        fields: the map's key `fields`; empty if the names are those of the message.
        size: how many fields both have.
        lacks: how many fields of the message the schema lacks.
        forms: how it writes numbers and octets, by key of the map.
        guess: why it may be another message; or empty.
    """

    at: str
    fields: dict[str, str]
    size: int
    lacks: int
    forms: dict[str, str]
    guess: str = ""

    @property
    def keys(self) -> dict[str, Any]:
        """Return the keys of the ROS map that express this fit."""
        return {name: value for name, value in (("at", self.at), ("fields", self.fields)) if value}


def places_of(schema: Schema) -> dict[str, dict[str, Schema]]:
    """Return each object in a schema by its position: the fields below it, by their positions in it."""
    leaves = dict(leaves_of(schema))
    steps = [at.split("/")[:-1] for at in leaves]
    places = sorted({"/".join(step[:end]) for step in steps for end in range(1, len(step) + 1)})
    return {
        place: {at.removeprefix(place): leaf for at, leaf in leaves.items() if at.startswith(f"{place}/")}
        for place in places[:_PLACES]
    }


def fit_of(places: dict[str, dict[str, Schema]], definition: Definition, message: str = "") -> Fit | None:
    """Return how a schema has the fields of a message, where in it it has most; None if it is another message.

    Args:
        places: places of the schema.
        definition: the definition of a type.
        message: a type in it; empty means itself.
    """
    own = dict(fields_of(definition, message))
    if not own:
        return Fit("", {}, 0, 0, {})
    by_key: dict[str, set[str]] = {}
    for pointer in own:
        steps = pointer.split("/")[1:]
        for first in range(len(steps)):
            by_key.setdefault(_key("".join(steps[first:])), set()).add(pointer)
    best, best_rank = cast("Fit | None", None), (0, 0)
    for place, below in places.items():
        pairs, forms = _pairs(below, by_key), dict[str, str]()
        lacks = len(own) - len(pairs)
        # A part of a message counts only if the body has all of that part, and it is at least half of the message.
        fits = not lacks or (len(pairs) == len(below) and 2 * len(pairs) >= len(places[""]))
        # With as many fields, and fewer others beside them, it is more likely the message.
        rank = (len(pairs), -len(below))
        if (
            fits
            and pairs
            and rank > best_rank
            and all(_has_type(below[web], own[one], definition, forms) for web, one in pairs.items())
        ):
            keys = [(_key(web), _key(one)) for web, one in pairs.items()]
            short = any(web != one and (not one.endswith(web) or _AXIS.fullmatch(web)) for web, one in keys)
            best_rank = rank
            best = Fit(
                place, _fields(pairs, own), len(pairs), lacks, forms, "some of its fields have short names." * short
            )
    return best


def _pairs(leaves: Collection[str], by_key: dict[str, set[str]]) -> dict[str, str]:
    """Return the position in a message of each field of a schema that has one.

    A field is known by its path however its words are written, or by the end of a path that no other field has; such
    as qw and frame by what they stand for; and the last one of many, as it is left.

    Args:
        leaves: the schema's fields.
        by_key: those of the message, by their paths and all ends of these.
    """
    found: dict[str, str] = {}
    for web in leaves:
        key, axis = _key(web), _AXIS.fullmatch(_key(web))
        for name in (key, f"{_LETTERS[axis[1]]}{axis[2]}" if axis else f"{key}id"):
            named = by_key.get(name, set())
            exact = {pointer for pointer in named if _key(pointer) == name} or named
            if web not in found and len(exact) == 1 and not exact <= {*found.values()}:
                found[web] = next(iter(exact))
    left = {pointer for pointers in by_key.values() for pointer in pointers}.difference(found.values())
    for web in {*leaves}.difference(found) if len(left) == 1 and len(leaves) == len(found) + 1 > FEW else ():
        found[web] = left.pop()
    return found


def _key(text: str) -> str:
    return re.sub("[^a-z0-9]", "", text.lower())


def _fields(pairs: dict[str, str], own: Collection[str]) -> dict[str, str]:
    """Return the key `fields` of the map for pairs of fields: equal ones below two positions follow from these."""
    if len(pairs) == len(own) and all(web == one for web, one in pairs.items()):
        return {}
    found: dict[str, str] = {}
    for web, one in pairs.items():
        here, there = web, one
        while here.rpartition("/")[2] == there.rpartition("/")[2]:
            above, over = here.rpartition("/")[0], there.rpartition("/")[0]
            below = [other.removeprefix(over) for other in own if other.startswith(f"{over}/")]
            if not above or not over or any(pairs.get(above + rest) != over + rest for rest in below):
                break
            here, there = above, over
        found[here] = there
    return found


def fields_of(definition: Definition, message: str = "", at: str = "") -> Iterator[tuple[str, Shape]]:
    """Yield the fields of a message that are no messages themselves, by position."""
    for name, shape in definition.fields(message):
        if shape.is_message and not shape.is_array:
            yield from fields_of(definition, shape.item, f"{at}/{name}")
        else:
            yield f"{at}/{name}", shape


def leaves_of(schema: Schema) -> Iterator[tuple[str, Schema]]:
    """Yield the fields of a schema that are no objects, by position; itself if it is none."""
    left: list[tuple[str, Schema]] = [("", schema)]
    for _ in range(_LEAVES):
        if not left:
            return
        at, one = left.pop(0)
        members = {name: member for part in parts_of(one) for name, member in part.get("properties", {}).items()}
        if members and at.count("/") < _DEPTH:
            places = {f"{at}/{name.replace('~', '~0').replace('/', '~1')}": member for name, member in members.items()}
            left[:0] = [(place, member) for place, member in places.items() if isinstance(member, dict)]
        else:
            yield at, one


def items_of(schema: Schema) -> Schema | None:
    """Return the schema of an array's items, or None."""
    return next((part["items"] for part in parts_of(schema) if isinstance(part.get("items"), dict)), None)


def _has_type(leaf: Schema, shape: Shape, definition: Definition, forms: dict[str, str]) -> bool:
    """Return whether a schema is that of a field; note how it writes numbers and octets."""
    kinds, items, parts = kinds_of(leaf), items_of(leaf), list(parts_of(leaf))
    if shape.is_octets:
        forms["bytes"] = "array" if "array" in kinds else "base64"
        return not kinds.isdisjoint({"string", "array"})
    if shape.is_array:
        if items is None or not shape.is_message:
            return items is not None and _has_type(items, Shape(shape.item), definition, forms)
        found = fit_of(places_of(items), definition, shape.item)
        forms |= found.forms if found else {}
        return found is not None and not (found.at or found.fields or found.lacks)
    if shape.item in LONG:
        forms["integers"] = "string" if "string" in kinds else "number"
    if shape.item in FLOATS and any("NaN" in part.get("enum", ()) for part in parts):
        forms["non_finite"] = "string"
    elif shape.item in FLOATS and any("null" in (part.get("type"), *part.get("type", ())) for part in parts):
        forms["non_finite"] = "null"
    wanted = {"integer", "number"} if shape.item in INTEGERS else {"number"} if shape.item in FLOATS else {shape.item}
    wanted |= {"string"} if shape.is_text or shape.item in LONG else set()
    return not kinds.isdisjoint(wanted)
