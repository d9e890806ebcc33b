"""The numbers that an operation's request commands, in body and path, their limits, and a body for them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final
from urllib.parse import quote

from conformance.documents.json_schema import Schema, is_numeric
from conformance.documents.openapi import Operation, is_json

_LASTS: Final = re.compile(r"duration|seconds|timeout|time|hold|ttl", re.IGNORECASE)
_TURNS: Final = re.compile(
    r"angular|angle|yaw|roll|pitch|turn|rot|theta|omega|heading|azimuth|orientation|\b[rw][xyz]\b|pan|tilt|joint",
    re.IGNORECASE,
)
# Names of numbers that are no axis: times, counts and ids.
NO_AXIS: Final = re.compile(
    r"^(?:n?anosec|nsec|sec|secs|stamp|timestamp|time|seq|sequence|id|uid|number|count|index|version|covariance|axis"
    r"|clientid|transactionid|clienttransactionid|servertransactionid|errornumber|battery|uptime)$|_(?:id|count)$|uuid$|number$|index$",
    re.IGNORECASE,
)
HOLDS: Final = re.compile(r"^(?:timeout|ttl|hold|valid_for)(?:_(?:m?s|sec|seconds))?$", re.IGNORECASE)
_MILLI: Final = re.compile(r"_ms$", re.IGNORECASE)
_ID: Final = re.compile(r"[a-z0-9]I[dD]$")
# Operations that command velocities; numbers that are velocities; numbers that only say how a move is made.
_DRIVES: Final = re.compile(r"velocit|twist|cmd_?vel|drive|speed|jog|continuous|moveaxis|\brates?\b", re.IGNORECASE)
FAST: Final = re.compile(r"speed|velocit|(?:^|_)vel(?:_|$)|throttle|(?:^|_|/)rate$", re.IGNORECASE)
_HOW: Final = re.compile(r"accel|decel|jerk|torque|force|effort|ramp", re.IGNORECASE)
_TWIST: Final = re.compile(r"(?:linear|angular)[/_]?[xyz]$", re.IGNORECASE)
# Greatest values of what is a share.
_SHARES: Final = frozenset({1.0, 100.0})
_MOVES_BY: Final = re.compile(r"relative|move_?by|nudge", re.IGNORECASE)
_RELATIVE: Final = re.compile(r"relative|distance|delta|offset|step", re.IGNORECASE)
_UNITS: Final = {
    "mm": r"_mm(?:_|$)|\b(?:mm|millimet)", "cm": r"_cm(?:_|$)|\b(?:cm|centimet)", "m": r"_m(?:_|$)|\bmet(?:re|er)s?\b",
    "deg": r"_(?:deg(?:rees)?|°)(?:_|$)|\bdeg(?:rees?)?\b|°", "rad": r"_rad(?:_|$)|\brad(?:ians?)?\b",
}  # fmt: skip
# Parts of a number's name that do not name the axis: words for a way, a position or a velocity.
_BESIDE: Final = re.compile(
    r"(?:^|_)(?:positions?|pos|distance|delta|offset|relative|steps?|target|velocity|vel|speed|rate|mm|cm|m|deg|degrees|rad|s)"
    r"(?=_|$)",
    re.IGNORECASE,
)
# Words of an enumeration that say the sign of a number, the positive one first.
_OPPOSITES: Final = (
    ("forward", "backward"), ("forward", "back"), ("forwards", "backwards"), ("forward", "reverse"), ("ahead", "back"),
    ("up", "down"), ("left", "right"), ("in", "out"), ("ccw", "cw"), ("positive", "negative"), ("plus", "minus"),
)  # fmt: skip
# Limits in the words of a description: both of them, or the greatest, each with a unit.
_AMOUNT = r"([-+]?\d+(?:\.\d+)?)"
_UNIT = r"((?:°|%|[a-z]+)(?:/s(?:ec)?|\s+per\s+second)?)?(?![\w.])"
_RANGE: Final = re.compile(
    rf"(?<![\w.]){_AMOUNT}\s*(?:[a-z/%°]+\s*)?(?:\bto\b|\.\.\.?|…)\s*{_AMOUNT}\s*{_UNIT}"
    rf"|\bbetween\s+{_AMOUNT}\s*(?:[a-z/%°]+\s+)?and\s+{_AMOUNT}\s*{_UNIT}|\[\s*{_AMOUNT}\s*,\s*{_AMOUNT}\s*\]\s*{_UNIT}",
    re.IGNORECASE,
)
_MOST: Final = re.compile(
    r"\b(?:at most|not? more than|up to|maximum(?: of)?|max\.?|limited to|(?:not|never) exceed(?:s|ing)?)"
    rf"\s*(?:±|\+/-)?\s*{_AMOUNT}\s*{_UNIT}",
    re.IGNORECASE,
)
# Words for a condition under which other limits apply.
_DOUBTS: Final = re.compile(
    r"\b(?:default|recommend|typical|usual|example|e\.g|unless|except|if|when|while|depend|about|approx|above|beyond|may)",
    re.IGNORECASE,
)
#: How deep a schema is read.
DEPTH: Final = 6
# A list of names in a description, as "[left, right]"; a longer list is no body of a command.
_LISTED: Final = re.compile(r"[\[(]\s*[a-z]\w*(?:\s*,\s*[a-z]\w*)+\s*[\])]", re.IGNORECASE)
_MOST_ITEMS: Final = 8
# Words of a description that name the items of a list in their order, a heading by one or two of them.
_WORDS: Final = re.compile(
    r"\b(?:x|y|z|left|right|front|rear|roll|pitch|pan|tilt|(?:heading|orientation|angle|yaw)\W+theta|theta|yaw|heading)\b",
    re.IGNORECASE,
)
_FORMS: Final = ("application/x-www-form-urlencoded", "multipart/form-data")
# Share of the declared limit at which the robot is driven. Without limits, it moves by _TURN rad or _WAY m.
_PART = 0.1
_TURN = 0.1
_WAY = 0.05
# Units in one metre, and roughly in one rad.
_IN_UNITS: Final = {"mm": 1000.0, "cm": 100.0, "deg": 50.0}


@dataclass(frozen=True)
class Commanded:
    """A number that a request commands.

    Attributes:
        name: what a map calls it.
        place: its JSON pointer in the body; of a path parameter its name in braces.
        schema: the schema of the number.
        turns: whether its names say that it is an angle, or turns the device.
        direction: where the body says its sign, and what it says there if it is positive or negative; None: the number
            has a sign.
        operation: path and id of the operation that takes it.
    """

    name: str
    place: str
    schema: Schema
    turns: bool
    direction: tuple[str, str, str] | None = None
    operation: str = ""

    @property
    def bounds(self) -> tuple[float, float] | None:
        """The least and the greatest value by the schema; None if it does not declare both."""
        said = self._in_words
        found = bounds_of(self.schema) or (said and (said[0], said[1]))
        return (-found[1], found[1]) if found and self.direction else found

    @property
    def source(self) -> str:
        """Where its limits come from, in words; empty if it has none."""
        if bounds_of(self.schema):
            return "as declared"
        return f'as its description says: "{self._in_words[2]}"' if self._in_words else ""

    @property
    def _in_words(self) -> tuple[float, float, str] | None:
        """The limits in its description, and their words; None if it names none, several, or what may change them."""
        text, least = str(self.schema.get("description", "")), _bound(self.schema, "minimum")
        found = [(one[0], [part for part in one.groups("") if part]) for one in _RANGE.finditer(text)]
        drives = self.direction or FAST.search(self.place) or _DRIVES.search(self.operation)
        found += [
            (one[0], [f"-{one[1]}" if least is None else str(least), one[1], *filter(None, [one[2]])])
            for one in (_MOST.finditer(text) if drives or least is not None else ())
        ]
        if len(found) != 1 or _DOUBTS.search(text):
            return None
        words, (low, high, *units) = found[0]
        said = [unit_of(f"_{re.split('[/ ]', unit)[0]}", {}) for unit in units if unit != "%"]
        known = all(unit and unit_of(self.place, {}) in {"", unit} for unit in said)
        return (float(low), float(high), words.strip()) if known and float(low) < float(high) else None

    @property
    def has_unit(self) -> bool:
        """Whether it is known in which unit it is: a share of the greatest, percent and counts are in none."""
        if self.bounds and self.bounds[1] in _SHARES:
            return bool(unit_of(self.place, {}))
        if unit_of(self.place, self.schema) or _TWIST.search(self.place):
            return True
        return bool(self.bounds) and self.schema.get("type") != "integer"

    @property
    def is_relative(self) -> bool:
        """Whether its name, or that of its operation, says that it is a way, and no position."""
        return bool(_RELATIVE.search(self.place) or _MOVES_BY.search(self.operation))

    @property
    def templates(self) -> dict[str, Any]:
        """What a body has for it, by JSON pointer."""
        if self.direction is None:
            return {self.place: f"{{{self.name}}}"}
        at, positive, negative = self.direction
        signs = {"sign_of": self.name, "positive": positive, "negative": negative}
        return {self.place: f"{{{self.name}:size}}", at: signs}

    @property
    def little(self) -> float:
        """A small change of the number: a tenth of the declared range, or 0.05 m/s or 0.1 rad/s."""
        unit = unit_of(self.place, self.schema)
        usual = (_TURN if self.turns else _WAY) * _IN_UNITS.get(unit, 1.0)
        if self.bounds is None:
            return usual
        part = min(_PART * max(map(abs, self.bounds)), 10 * usual if unit else math.inf)
        return max(1.0, part) if self.schema.get("type") == "integer" else part

    @property
    def limits(self) -> tuple[float, float]:
        """Its limits in a map: those declared, or twice a little."""
        if self.bounds is None:
            return -2 * self.little, 2 * self.little
        return self.bounds


def bounds_of(schema: Schema) -> tuple[float, float] | None:
    """Return the least and the greatest number of a schema; None if it does not declare both."""
    least, most = _bound(schema, "minimum"), _bound(schema, "maximum")
    return (float(least), float(most)) if least is not None and most is not None and least < most else None


def unit_of(place: str, schema: Schema) -> str:
    """Return the unit of a number that its name or its description says; empty if neither does."""
    said = (place, str(schema.get("description", "")))
    return next((unit for text in said for unit, words in _UNITS.items() if re.search(words, text, re.IGNORECASE)), "")


def is_velocity(operation: Operation, numbers: Sequence[Commanded]) -> bool:
    """Return whether an operation commands velocities, by its name or by those of its numbers; else positions."""
    return bool(_DRIVES.search(f"{operation.template} {operation.id}")) or all(
        FAST.search(command.place) for command in numbers
    )


def _bound(schema: Schema, word: str) -> float | None:
    for part in parts_of(schema):
        for key in (word, f"exclusive{word.capitalize()}"):
            value = part.get(key)
            if isinstance(value, int | float) and not isinstance(value, bool):
                return value
    return None


def commanded_by(operation: Operation) -> list[Commanded]:
    """Return the numbers that a request commands, without durations, ids, times, and how fast a move is made."""
    schema = body_schema(operation) or {}
    inside = [(at, at, part) for at, part in numbers_in(schema) if is_axis(member_name(at))]
    found = [
        (f"{{{parameter.name}}}", parameter.name, parameter.schema)
        for parameter in operation.parameters
        if f"{{{parameter.name}}}" in operation.template and is_numeric(parameter.schema) and is_axis(parameter.name)
        # Beside numbers in a body, a whole number in the path is an id.
        if not (inside and parameter.schema.get("type") == "integer")
    ]
    found += inside
    velocities = _DRIVES.search(f"{operation.template} {operation.id}")
    found = [one for one in found if not (_HOW.search(one[1]) or (not velocities and FAST.search(one[1])))] or found
    names = unique_names([at for at, _, _ in found], titles_in(schema))
    signs = _signs(schema) if len(found) == 1 else None
    called = f"{operation.template} {operation.id}"
    return [
        Commanded(
            names[at], at, part, bool(_TURNS.search(f"{said} {operation.template if not at else ''}")), signs, called
        )
        for at, said, part in found
    ]


def with_query(operation: Operation, lease: str = "") -> Operation:
    """Return an operation whose path has the query that a command needs; ``lease``: the parameter that carries one."""
    given = []
    for item in operation.parameter("query"):
        if item.name == lease:
            given.append(f"{item.name}={{lease}}")
        elif is_numeric(item.schema) and is_axis(item.name):
            given.append(f"{item.name}={{{item.name}}}")
        elif HOLDS.search(item.name):
            given.append(f"{item.name}={_lasting(item.name, item.schema):g}")
        elif is_numeric(item.schema) and _LASTS.search(item.name):
            given.append(f"{item.name}={{seconds}}")
        elif item.required:
            given.append(f"{item.name}={quote(str(usual_value(item.schema)), safe='')}")
    return replace(operation, template=f"{operation.template}?{'&'.join(given)}") if given else operation


def _signs(schema: Schema) -> tuple[str, str, str] | None:
    """Return where a body says in a word which way to go, and the words for both ways."""
    for part in parts_of(schema):
        for name, member in part.get("properties", {}).items():
            words = (
                {str(item).lower(): str(item) for item in member.get("enum", ())} if isinstance(member, dict) else {}
            )
            for positive, negative in _OPPOSITES:
                if {positive, negative} <= words.keys():
                    return f"/{name}", words[positive], words[negative]
    return None


def member_name(place: str) -> str:
    """Return the name of a member at a JSON pointer; of an item of a list that of the list."""
    return next((part for part in reversed(place.split("/")) if not part.isdecimal()), "")


def axis_of(place: str) -> str:
    """Return a number's name without its unit and without words for a position or a velocity."""
    last = place.rpartition("/")[2]
    item = f"_{last}" if last.isdecimal() else ""
    return f"{_BESIDE.sub('', member_name(place)).strip('_').lower()}{item}"


def is_axis(name: str) -> bool:
    """Return whether a number of this name may be an axis or a velocity."""
    return not (NO_AXIS.search(name) or _LASTS.search(name) or _ID.search(name))


def titles_in(schema: Schema | None) -> dict[str, str]:
    """Return the names of the items of lists that a schema describes, by JSON pointer."""
    numbers = numbers_in(schema or {})
    return {at: str(part["title"]) for at, part in numbers if at.rpartition("/")[2].isdecimal() and "title" in part}


def unique_names(places: Sequence[str], titles: Mapping[str, str] = MappingProxyType({})) -> dict[str, str]:
    """Return a name for each place, as short as possible and unique; ``titles``: the names of items of lists."""
    called = {at: f"{at.rpartition('/')[0]}/{titles[at]}" if at in titles else at for at in places}
    parts = {
        at: [part for part in re.split(r"[/#@]", text.strip("{}")) if part] or ["value"] for at, text in called.items()
    }
    parts = {at: ["axis", *own] if all(map(str.isdecimal, own)) else own for at, own in parts.items()}
    for length in range(1, DEPTH + 2):
        names = {at: "_".join(one[-_least(one, length) :]) for at, one in parts.items()}
        if len(set(names.values())) == len(names):
            break
    return {at: re.sub(r"[^A-Za-z0-9_-]", "_", name) for at, name in names.items()}


def _least(parts: Sequence[str], length: int) -> int:
    """Return how many of the last parts make a name that is not only a number."""
    while length < len(parts) and all(part.isdecimal() for part in parts[-length:]):
        length += 1
    return length


def body_schema(operation: Operation) -> Schema | None:
    """Return the schema of the body that a map fills, JSON if declared, else a form; None if it has no such body."""
    names = [*filter(is_json, operation.bodies), *(name for name in operation.bodies if name in _FORMS)]
    return operation.bodies[names[0]].schema if names else None


def parts_of(schema: Any) -> Iterator[Schema]:
    """Yield a schema and its alternatives."""
    if not isinstance(schema, dict):
        return
    yield schema
    for key in ("allOf", "anyOf", "oneOf"):
        for part in schema.get(key, ()):
            yield from parts_of(part)


def lasting(schema: Schema | None) -> dict[str, float]:
    """Return a second for each member of a body that says for how long a velocity holds, by JSON pointer."""
    return {at: _lasting(at, part) for at, part in numbers_in(schema or {}) if HOLDS.search(member_name(at))}


def _lasting(name: str, schema: Schema) -> float:
    """Return a second, in the unit of a number, or the nearest that its schema allows."""
    least, most = bounds_of(schema) or (0.0, 1e6)
    return min(max(1000.0 if _MILLI.search(name) else 1.0, least), most)


def numbers_in(schema: Schema, at: str = "", depth: int = DEPTH) -> Iterator[tuple[str, Schema]]:
    """Yield the JSON pointers of the numbers in an object or a list, with their schemas, each once."""
    seen = set[str]()
    for part in parts_of(schema) if depth else ():
        for name, member in members_in(part):
            place = f"{at}/{name}"
            if place in seen:
                continue
            seen.add(place)
            if is_numeric(member):
                yield place, member
            else:
                yield from numbers_in(member, place, depth - 1)


def members_in(part: Schema) -> Iterator[tuple[str, Schema]]:
    """Yield the members of an object, or the items of a list whose length is known, each with its step of a pointer."""
    for name, member in part.get("properties", {}).items():
        if isinstance(member, dict):
            yield name.replace("~", "~0").replace("/", "~1"), member
    first, length = part.get("prefixItems", ()), list_length(part)
    said = _WORDS.findall(str(part.get("description", "")))
    names = [str(name).lower() for name in (_item_names(part) or said)]
    # If a list's description has as many limits as items, each limit is for the item at the same place.
    ranges, unit = [one[0] for one in _RANGE.finditer(str(part.get("description", "")))], unit_of("", part)
    for index in range(length):
        item = first[index] if index < len(first) else part.get("items")
        if isinstance(item, dict):
            limits = {"description": f"{ranges[index]} {unit}"} if length == len(ranges) > 1 else {}
            yield str(index), {**({"title": names[index]} if len(names) == length else {}), **limits, **item}


def _item_names(part: Schema) -> list[str]:
    """Return the names of a list's items, as a description such as "[left, right]" has them; or none."""
    found = _LISTED.search(str(part.get("description", "")))
    return re.findall(r"\w+", found[0]) if found else []


def list_length(part: Schema) -> int:
    """Return the length of a list, as its schema, an example or a description such as "[left, right]" says; or 0."""
    if not {"items", "prefixItems"} & part.keys():
        return 0
    lengths: tuple[int, ...] = (
        len(part.get("prefixItems", ())),
        part.get("minItems", 0),
        *(len(part[key]) for key in ("default", "example") if isinstance(part.get(key), list)),
        len(_item_names(part)),
    )
    most: int = part.get("maxItems", _MOST_ITEMS)
    length = min(next(filter(None, lengths), 0), most)
    return length if length <= _MOST_ITEMS else 0


def usual_value(schema: Schema) -> Any:
    """Return a value that a schema declares: its default, constant, example or first choice, or the least usual one."""
    for part in parts_of(schema):
        for key in ("default", "const", "example"):
            if part.get(key) is not None:
                return part[key]
        for key in ("enum", "examples"):
            if isinstance(part.get(key), list) and part[key]:
                return part[key][0]
    kinds = {part.get("type") for part in parts_of(schema)}
    if is_numeric(schema):
        least = _bound(schema, "minimum")
        return max(0, least) if least is not None else 0
    return False if "boolean" in kinds else [] if "array" in kinds else {} if "object" in kinds else ""
