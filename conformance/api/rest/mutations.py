"""Named mutations of a valid JSON value: each breaks the contract in one way, at one place."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from conformance.api.rest.calls import minimal
from conformance.documents.json_schema import Schema, kind_of, shape_of, types_of
from conformance.documents.json_text import read_json
from conformance.documents.representation import flat
from conformance.documents.writing import Pairs, Token, json_text

Path = tuple[str | int, ...]
# Names in class strict-input of what may ask for the refusal of a mutation.
MUTATED = (
    "json-malformed",
    "json-missing",
    "json-unknown",
    "json-duplicate",
    "json-type",
    "json-non-finite",
    "json-root",
    "json-depth",
    "json-huge-number",
    "json-encoding",
    "json-empty",
    "json-bounds",
)
# What nobody names a field or a value by chance.
STRANGE_NAME = "roaas_unknown"
STRANGE_TEXT = "roaas-no-number"
_DEPTH = 100_000
_DIGITS = 5_000


@dataclass(frozen=True)
class Mutation:
    """One invalid body.

    Attributes:
        name: what was done, and where.
        requirement: name in class strict-input of what asks for its refusal.
        body: octets.
        field: name of the field that is wrong, or empty.
        shown: what a refusal can name of the value, or empty.
        malformed: whether it is no JSON at all (400) rather than JSON of a wrong shape or value (422); None: either.
    """

    name: str
    requirement: str
    body: bytes
    field: str = ""
    shown: str = ""
    malformed: bool | None = None


@dataclass(frozen=True)
class _Place:
    """One place in a value: its path, what is there, and its schema."""

    path: Path
    value: Any
    schema: Schema

    @property
    def field(self) -> str:
        return next((str(part) for part in reversed(self.path) if isinstance(part, str)), "")

    @property
    def where(self) -> str:
        return ".".join(str(part) for part in self.path) or "the body"


def places(value: Any, schema: Schema, path: Path = ()) -> Iterator[_Place]:
    """Every place in a value, the value itself first."""
    schema = flat(schema)
    yield _Place(path, value, schema)
    if isinstance(value, dict):
        for name, item in value.items():
            yield from places(item, schema.get("properties", {}).get(name, {}), (*path, name))
    elif isinstance(value, list):
        for index, item in enumerate(value[:2]):
            yield from places(item, schema.get("items", {}), (*path, index))


def replaced(value: Any, path: Path, new: Any) -> Any:
    """A copy of a value with another one at a place."""
    if not path:
        return new
    first, *rest = path
    if isinstance(value, dict):
        return {name: replaced(item, tuple(rest), new) if name == first else item for name, item in value.items()}
    return [replaced(item, tuple(rest), new) if index == first else item for index, item in enumerate(value)]


def with_options(value: Any, schema: Schema) -> Iterator[tuple[Any, _Place]]:
    """The value with one optional field more, for each that it lacks; and the place of that field."""
    known = {place.field: place.value for place in places(value, schema) if isinstance(place.value, str)}
    for place in places(value, schema):
        if not isinstance(place.value, dict):
            continue
        for name, part in place.schema.get("properties", {}).items():
            if name not in place.value:
                added = _with_known(minimal(part), known)
                whole = replaced(value, place.path, {**place.value, name: added})
                yield whole, _Place((*place.path, name), added, flat(part))


def _with_known(value: Any, known: dict[str, str]) -> Any:
    """A value whose texts are those that the example has under the same name: a frame that the robot knows."""
    if not isinstance(value, dict):
        return value
    return {
        name: known.get(name, item) if isinstance(item, str) else _with_known(item, known)
        for name, item in value.items()
    }


def mutations(value: Any, schema: Schema) -> list[Mutation]:
    """Every mutation of a valid value that is invalid on the wire."""
    made = [*_of_text(value), *_of_root(value), *_of_places(value, list(places(value, schema)))]
    for whole, place in with_options(value, schema):
        made += _of_places(whole, list(places(place.value, place.schema, place.path)))
    made += _of_size(value, schema)
    return [item for item in made if is_invalid(item.body, schema)]


def near_misses(value: Any, schema: Schema, number: Path) -> list[Mutation]:
    """The mutations that a lenient reader would take for the valid value, one of whose numbers is at ``number``."""
    nearly_all = json_text(value).encode()[:-1]
    made = [item for item in (*_of_text(value), *_of_root(value)) if nearly_all in item.body]
    for place in places(value, schema):
        if place.path == number:
            non_finite = (item for item in _of_leaf(value, place) if item.requirement == "json-non-finite")
            made += [*_of_type(value, place), *non_finite]
        elif place.path in {(), number[:-1]}:
            made += _of_object(value, place)
    return [item for item in made if is_invalid(item.body, schema)]


def is_invalid(body: bytes, schema: Schema) -> bool:
    """Whether what is really sent breaks the contract: confirmed on the octets, not on the value that was meant."""
    text = read_json(body)
    return bool(text.problem) or bool(shape_of(schema).problem(text.value))


def _of_text(value: Any) -> Iterator[Mutation]:
    valid = json_text(value).encode()

    def malformed(name: str, body: bytes) -> Mutation:
        return Mutation(name, "json-malformed", body, malformed=True)

    yield malformed("cut short", valid[:-1])
    yield malformed("a closing brace too many", valid + b"}")
    yield malformed("a second value behind", valid + b" {}")
    yield malformed("single quotes", valid.replace(b'"', b"'"))
    yield malformed("names without quotes", valid.replace(b'"', b""))
    yield malformed("a comma behind the last member", valid[:-1] + b",}")
    yield malformed("a comment", b"/* valid otherwise */ " + valid)
    yield malformed("form data", b"x=0.1&y=0")
    yield malformed("XML", b"<x>0.1</x>")
    yield malformed("a word", b"stop")
    yield Mutation("no octets", "json-empty", b"", malformed=True)
    yield Mutation("white space only", "json-empty", b" \n", malformed=True)
    text = valid.decode()
    yield Mutation("UTF-16", "json-encoding", text.encode("utf-16"), malformed=True)
    yield Mutation("UTF-16 without a mark", "json-encoding", text.encode("utf-16-le"), malformed=True)
    yield Mutation("an octet that is no UTF-8", "json-encoding", valid[:-1] + b', "\xff": 0}', malformed=True)
    yield Mutation("Latin-1", "json-encoding", valid[:-1] + b', "na\xefve": 0}', malformed=True)


def _of_root(value: Any) -> Iterator[Mutation]:
    if not isinstance(value, dict):
        return
    for name, root in (
        ("an array", [value]),
        ("an empty array", []),
        ("a string", "stop"),
        ("a number", 1),
        ("null", None),
        ("true", True),
        ("the body as a string", json.dumps(value)),
    ):
        yield Mutation(f"{name} as root", "json-root", json_text(root).encode(), malformed=False)


def _of_places(whole: Any, found: list[_Place]) -> list[Mutation]:
    made: list[Mutation] = []
    for place in found:
        made += _of_object(whole, place) if isinstance(place.value, dict) else _of_leaf(whole, place)
        if place.path:
            made += _of_type(whole, place)
        made += _of_bounds(whole, place)
    return made


def _mutation(whole: Any, place: _Place, requirement: str, what: str, new: Any, **more: Any) -> Mutation:
    body = json_text(replaced(whole, place.path, new)).encode()
    return Mutation(f"{what} at {place.where}", requirement, body, **{"field": place.field, "malformed": False, **more})


def _of_object(whole: Any, place: _Place) -> Iterator[Mutation]:
    members = place.value
    for name in place.schema.get("required", ()):
        rest = {key: item for key, item in members.items() if key != name}
        yield _mutation(whole, place, "json-missing", f"{name} missing", rest, field=name)
    yield _mutation(whole, place, "json-unknown", "an unknown field", {**members, STRANGE_NAME: 0}, field=STRANGE_NAME)
    for name in members:
        # json_text() looks for Token and Pairs anywhere, so the object can be put back as a list of its members.
        twice = Pairs((*members.items(), (name, members[name])))
        yield _mutation(whole, place, "json-duplicate", f"{name} twice", twice, field="", malformed=None)
        other = Pairs(((name, None), *members.items()))
        yield _mutation(whole, place, "json-duplicate", f"{name} twice, first as null", other, field="", malformed=None)


def _of_leaf(whole: Any, place: _Place) -> Iterator[Mutation]:
    if not set(types_of(place.schema)) & {"number", "integer"}:
        return
    for text in ("NaN", "Infinity", "-Infinity"):
        yield _mutation(whole, place, "json-non-finite", text, Token(text), field="", malformed=True)
    for text in ("1e400", "-1e400"):
        yield _mutation(whole, place, "json-non-finite", text, Token(text), field="")
    for text in ("01.5", "+1.5", ".5", "0x10", "1,5", "1."):
        yield _mutation(whole, place, "json-malformed", f"the number {text}", Token(text), field="", malformed=True)


def _of_type(whole: Any, place: _Place) -> Iterator[Mutation]:
    wrong: list[tuple[str, Any]] = [
        ("null", None),
        ("a string", STRANGE_TEXT),
        ("a number as a string", "0.1"),
        ("true", True),
        ("an array", [place.value]),
        ("an empty object", {}),
        ("a number", 7),
    ]
    for what, new in wrong:
        if not shape_of(place.schema).problem(new):
            continue
        shown = STRANGE_TEXT if new == STRANGE_TEXT else ""
        required = "json-type" if kind_of(place.schema) != "object" or new != {} else "json-missing"
        field = "" if required == "json-missing" else place.field
        yield _mutation(whole, place, required, what, new, shown=shown, field=field)


def _of_bounds(whole: Any, place: _Place) -> Iterator[Mutation]:
    schema = place.schema
    beyond: list[tuple[str, Any]] = []
    for key, step in (("minimum", -1), ("exclusiveMinimum", 0), ("maximum", 1), ("exclusiveMaximum", 0)):
        if isinstance(schema.get(key), int | float) and not isinstance(schema.get(key), bool):
            beyond.append((f"beyond its {key}", schema[key] + step))
    if schema.get("minLength", 0) > 0:
        beyond.append(("a text too short", "a" * (schema["minLength"] - 1)))
    if "maxLength" in schema:
        beyond.append(("a text too long", "a" * (schema["maxLength"] + 1)))
    if "pattern" in schema or "enum" in schema or "const" in schema:
        integers = kind_of(schema) == "integer"
        beyond.append(("a value that is not one of those allowed", 2**31 - 1 if integers else STRANGE_TEXT))
    if schema.get("minItems", 0) > 0 and isinstance(place.value, list):
        beyond.append(("too few items", place.value[: schema["minItems"] - 1]))
    if "maxItems" in schema and isinstance(place.value, list) and place.value:
        beyond.append(("too many items", [place.value[0]] * (schema["maxItems"] + 1)))
    if kind_of(schema) == "integer":
        beyond.append(("a fraction", 0.5))
    for what, new in beyond:
        yield _mutation(whole, place, "json-bounds", what, new)


def _of_size(value: Any, schema: Schema) -> Iterator[Mutation]:
    deep = b"[" * _DEPTH + b"]" * _DEPTH
    yield Mutation(f"{_DEPTH:,} arrays in each other", "json-depth", deep)
    yield Mutation(f"{_DEPTH:,} objects in each other", "json-depth", b'{"a":' * _DEPTH + b"0" + b"}" * _DEPTH)
    digits = Token("1" * _DIGITS)
    for place in places(value, schema):
        if isinstance(place.value, dict | list) or not place.path:
            continue
        nested = json_text(replaced(value, place.path, Token(deep.decode()))).encode()
        yield Mutation(f"{_DEPTH:,} arrays at {place.where}", "json-depth", nested)
        if set(types_of(place.schema)) & {"number", "integer"}:
            body = json_text(replaced(value, place.path, digits)).encode()
            yield Mutation(f"an integer of {_DIGITS:,} digits at {place.where}", "json-huge-number", body)
