"""Invalid variants of a valid JSON or XML body, each with one fault at one place."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from conformance.api.mutations import STRANGE_NAME, STRANGE_TEXT, Member, Mutation, broken_members
from conformance.api.rest.samples import alike_and_apart, sample
from conformance.api.rest.variations import with_member
from conformance.documents.json_schema import Schema, kind_of, numbers_in, types_of
from conformance.documents.json_shape import shape_of
from conformance.documents.json_text import read_json
from conformance.documents.representation import UnreadableError, flat, from_element, local_name, parse_xml
from conformance.documents.writing import Pairs, Token, json_text, xml_bytes

Path = tuple[str | int, ...]
#: The kinds of faults in a JSON body; the ids of class strict-input end with them.
KINDS = (
    "malformed",
    "missing",
    "unknown",
    "duplicate",
    "type",
    "non-finite",
    "root",
    "depth",
    "huge-number",
    "encoding",
    "empty",
    "bounds",
)
# Texts that are no JSON number or no double: name of the fault, whether it makes the body malformed, and the texts.
_NO_NUMBERS = (
    ("non-finite", True, ("NaN", "Infinity", "-Infinity")),
    ("non-finite", False, ("1e400", "-1e400")),
    ("malformed", True, ("01.5", "+1.5", ".5", "0x10", "1,5", "1.")),
)
_DEPTH = 100_000
_DIGITS = 5_000
# The longest text or list that is sent, even if its bound allows more.
_LONGEST = 1 << 20


@dataclass(frozen=True)
class Place:
    """One place in a JSON value: its path, its value, and its schema."""

    path: Path
    value: Any
    schema: Schema

    @property
    def field(self) -> str:
        """Return the member's name; for an item of an array, the array's name."""
        return next((str(part) for part in reversed(self.path) if isinstance(part, str)), "")

    @property
    def where(self) -> str:
        """The path in words."""
        return ".".join(str(part) for part in self.path) or "the body"

    @property
    def is_number(self) -> bool:
        """Whether the contract allows numbers here."""
        return bool({"number", "integer"} & set(types_of(self.schema)))

    def members_broken(self, write: Callable[[Any], bytes]) -> Iterator[Mutation[bytes]]:
        """Yield the mutations of an object's members; ``write`` returns the document with another value here."""
        required = self.schema.get("required", ())
        members = [Member(name, (name, item), name in required) for name, item in self.value.items()]
        strange = [Member(STRANGE_NAME, (STRANGE_NAME, 0))]
        return broken_members(self.where, members, strange, lambda items: write(Pairs(tuple(items))))


def places(value: Any, schema: Schema, path: Path = ()) -> Iterator[Place]:
    """Yield every place in a value, the value itself first."""
    schema = flat(schema)
    yield Place(path, value, schema)
    if isinstance(value, dict):
        for name, item in value.items():
            yield from places(item, schema.get("properties", {}).get(name, {}), (*path, name))
    elif isinstance(value, list):
        for index, item in enumerate(value[:2]):
            yield from places(item, schema.get("items", {}), (*path, index))


def replaced(value: Any, path: Path, new: Any) -> Any:
    """Return a copy of a value with another value at a place."""
    return with_member(value, path, new) if path else new


def with_options(value: Any, schema: Schema) -> Iterator[tuple[Any, Place]]:
    """Yield the value with one missing optional member added, for each; and the place of that member."""
    known = {place.field: place.value for place in places(value, schema) if isinstance(place.value, str)}
    for place in places(value, schema):
        if not isinstance(place.value, dict):
            continue
        for name, part in place.schema.get("properties", {}).items():
            if name not in place.value:
                added = _with_known(sample(part), known)
                whole = replaced(value, place.path, {**place.value, name: added})
                yield whole, Place((*place.path, name), added, flat(part))


def _with_known(value: Any, known: dict[str, str]) -> Any:
    """Return a value whose texts are those of the example's members of the same name, such as a known frame."""
    if not isinstance(value, dict):
        return value
    return {
        name: known.get(name, item) if isinstance(item, str) else _with_known(item, known)
        for name, item in value.items()
    }


def mutations(value: Any, schema: Schema) -> list[Mutation[bytes]]:
    """Return all mutations of a valid value that are invalid once serialised."""
    made = [*_of_text(value), *_of_root(value), *_of_places(value, list(places(value, schema)))]
    for whole, place in with_options(value, schema):
        made += _of_places(whole, list(places(place.value, place.schema, place.path)))
    made += _of_size(value, schema)
    return [item for item in made if is_invalid(item.made, schema)]


def near_misses(value: Any, schema: Schema, number: Path) -> list[Mutation[bytes]]:
    """Return mutations that a lenient parser would read as the valid value, which has a number at ``number``."""
    nearly_all = json_text(value).encode()[:-1]
    made = [item for item in (*_of_text(value), *_of_root(value)) if nearly_all in item.made]
    for place in places(value, schema):
        if place.path == number:
            made += [*_of_type(value, place), *(item for item in _of_leaf(value, place) if item.kind == "non-finite")]
        elif place.path in {(), number[:-1]}:
            made += _of_object(value, place)
    return [item for item in made if is_invalid(item.made, schema)]


def is_invalid(body: bytes, schema: Schema) -> bool:
    """Return whether the bytes of a body violate the contract."""
    text = read_json(body)
    return bool(text.problem) or not shape_of(schema).holds(text.value)


def _of_text(value: Any) -> Iterator[Mutation[bytes]]:
    valid = json_text(value).encode()
    for kind, what, body in (
        ("malformed", "a body cut short", valid[:-1]),
        ("malformed", "a closing brace too many", valid + b"}"),
        ("malformed", "a second value behind", valid + b" {}"),
        ("malformed", "single quotes", valid.replace(b'"', b"'")),
        ("malformed", "names without quotes", valid.replace(b'"', b"")),
        ("malformed", "a comma behind the last member", valid[:-1] + b",}"),
        ("malformed", "a comment", b"/* valid otherwise */ " + valid),
        ("malformed", "form data", b"x=0.1&y=0"),
        ("malformed", "XML", b"<x>0.1</x>"),
        ("malformed", "a word", b"stop"),
        ("empty", "no bytes", b""),
        ("empty", "white space only", b" \n"),
        ("encoding", "UTF-16", valid.decode().encode("utf-16")),
        ("encoding", "UTF-16 without a mark", valid.decode().encode("utf-16-le")),
        ("encoding", "an octet that is no UTF-8", valid[:-1] + b', "\xff": 0}'),
        ("encoding", "Latin-1", valid[:-1] + b', "na\xefve": 0}'),
    ):
        yield Mutation(kind, what, body, malformed=True)


def _of_root(value: Any) -> Iterator[Mutation[bytes]]:
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
        yield Mutation("root", f"{name} as root", json_text(root).encode(), malformed=False)


def _of_places(whole: Any, found: list[Place]) -> list[Mutation[bytes]]:
    made: list[Mutation[bytes]] = []
    for place in found:
        made += _of_object(whole, place) if isinstance(place.value, dict) else _of_leaf(whole, place)
        if place.path:
            made += _of_type(whole, place)
        made += _of_bounds(whole, place)
    return made


def _writer(whole: Any, place: Place) -> Callable[[Any], bytes]:
    """Return a function that serialises the whole value with another value at a place."""
    return lambda new: json_text(replaced(whole, place.path, new)).encode()


def _of_object(whole: Any, place: Place) -> Iterator[Mutation[bytes]]:
    write = _writer(whole, place)
    for item in place.members_broken(write):
        yield replace(item, field="") if item.kind == "duplicate" else item
    for name in place.value:
        other = write(Pairs(((name, None), *place.value.items())))
        yield Mutation("duplicate", f"{name} twice, first as null, at {place.where}", other)


def _of_leaf(whole: Any, place: Place) -> Iterator[Mutation[bytes]]:
    if not place.is_number:
        return
    write = _writer(whole, place)
    for kind, malformed, texts in _NO_NUMBERS:
        for text in texts:
            yield Mutation(kind, f"{text} at {place.where}", write(Token(text)), malformed=malformed)


def _of_type(whole: Any, place: Place) -> Iterator[Mutation[bytes]]:
    write = _writer(whole, place)
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
        if not shape_of(place.schema).holds(new):
            shown = STRANGE_TEXT if new == STRANGE_TEXT else ""
            is_lacking = kind_of(place.schema) == "object" and new == {}
            kind, name = ("missing", "") if is_lacking else ("type", place.field)
            yield Mutation(kind, f"{what} at {place.where}", write(new), name, shown, malformed=False)


def _of_bounds(whole: Any, place: Place) -> Iterator[Mutation[bytes]]:
    write = _writer(whole, place)
    schema = place.schema
    beyond: list[tuple[str, Any]] = []
    for key, step in (("minimum", -1), ("exclusiveMinimum", 0), ("maximum", 1), ("exclusiveMaximum", 0)):
        if isinstance(schema.get(key), int | float) and not isinstance(schema.get(key), bool):
            beyond.append((f"beyond its {key}", schema[key] + step))
    if 0 < schema.get("minLength", 0) <= _LONGEST:
        beyond.append(("a text too short", "a" * (schema["minLength"] - 1)))
    if schema.get("maxLength", _LONGEST) < _LONGEST:
        beyond.append(("a text too long", "a" * (schema["maxLength"] + 1)))
    if "pattern" in schema or "enum" in schema or "const" in schema:
        integers = kind_of(schema) == "integer"
        beyond.append(("a value that is not one of those allowed", 2**31 - 1 if integers else STRANGE_TEXT))
    if schema.get("minItems", 0) > 0 and isinstance(place.value, list):
        beyond.append(("too few items", place.value[: schema["minItems"] - 1]))
    if schema.get("maxItems", _LONGEST) < _LONGEST and isinstance(place.value, list) and place.value:
        count = schema["maxItems"] + 1
        # Equal items may be refused for that.
        apart = alike_and_apart({**schema, "minItems": count})[1]
        beyond.append(("too many items", apart or [place.value[0]] * count))
    if kind_of(schema) == "integer":
        beyond.append(("a fraction", 0.5))
    for what, new in beyond:
        yield Mutation("bounds", f"{what} at {place.where}", write(new), place.field, malformed=False)


def _of_size(value: Any, schema: Schema) -> Iterator[Mutation[bytes]]:
    deep = b"[" * _DEPTH + b"]" * _DEPTH
    yield Mutation("depth", f"{_DEPTH:,} arrays in each other", deep)
    yield Mutation("depth", f"{_DEPTH:,} objects in each other", b'{"a":' * _DEPTH + b"0" + b"}" * _DEPTH)
    for place in places(value, schema):
        if isinstance(place.value, dict | list) or not place.path:
            continue
        write = _writer(value, place)
        yield Mutation("depth", f"{_DEPTH:,} arrays at {place.where}", write(Token(deep.decode())))
        if place.is_number:
            what = f"an integer of {_DIGITS:,} digits at {place.where}"
            yield Mutation("huge-number", what, write(Token("1" * _DIGITS)))


_NO_XML_NUMBERS = (STRANGE_TEXT, "NaN", "INF", "-INF", "Infinity", "1e400", "", "0.1 0.2", "1,5")


def xml_mutations(value: Any, schema: Schema, root: str) -> list[Mutation[bytes]]:
    """Return every mutation of a valid body that is invalid on the wire.

    Args:
        value: a valid one.
        schema: the schema of the body.
        root: name of the root element.
    """
    made = [*_of_document(value, root), *_of_xml_places(value, schema, root)]
    return [item for item in made if _is_invalid_xml(item.made, schema, root)]


def _of_document(value: Any, root: str) -> Iterator[Mutation[bytes]]:
    valid = xml_bytes(value, root)
    for what, body in (
        ("no bytes", b""),
        ("XML cut short", valid[: -len(root) - 1]),
        ("an end tag without a start", valid + f"</{root}>".encode()),
        ("JSON in place of XML", b'{"x": 0.1}'),
        ("another root element", xml_bytes(value, STRANGE_NAME)),
        ("an empty root element", f"<{root}/>".encode()),
        ("text in the root element", f"<{root}>stop</{root}>".encode()),
    ):
        yield Mutation("document", what, body)


def _of_xml_places(value: Any, schema: Schema, root: str) -> Iterator[Mutation[bytes]]:
    for place in places(value, schema):
        write = _xml_writer(value, place, root)
        if isinstance(place.value, dict):
            yield from place.members_broken(write)
            if place.path:
                yield Mutation("type", f"text at {place.where}", write("stop"))
        elif place.is_number:
            for text in _NO_XML_NUMBERS:
                named = (place.field, text) if text == STRANGE_TEXT else ()
                yield Mutation("lexical", f"{text or 'nothing'!r} at {place.where}", write(text), *named)
            yield Mutation("type", f"an element at {place.where}", write({STRANGE_NAME: 0}))


def _xml_writer(value: Any, place: Place, root: str) -> Callable[[Any], bytes]:
    """Return a function that writes the whole value with another one at a place."""
    return lambda new: xml_bytes(replaced(value, place.path, new), root)


def _is_invalid_xml(body: bytes, schema: Schema, root: str) -> bool:
    """Return whether a body breaks the contract, read as the contract reads XML."""
    try:
        element = parse_xml(body)
    except UnreadableError:
        return True
    if local_name(element) != root or STRANGE_NAME.encode() in body:
        return True
    value = from_element(element, schema)
    return not shape_of(schema).holds(value) or any(abs(item) == float("inf") for item in numbers_in(value))
