"""Mutations of a valid XML body: each breaks the contract in one way, at one place."""

from collections.abc import Callable, Iterator
from typing import Any

from conformance.api.mutations import STRANGE_NAME, STRANGE_TEXT, Mutation
from conformance.api.rest.json_mutations import Place, places, replaced
from conformance.documents.json_schema import Schema, numbers_in
from conformance.documents.json_shape import shape_of
from conformance.documents.representation import UnreadableError, from_element, local_name, parse_xml
from conformance.documents.writing import xml_bytes

_NO_NUMBERS = (STRANGE_TEXT, "NaN", "INF", "-INF", "Infinity", "1e400", "", "0.1 0.2", "1,5")


def xml_mutations(value: Any, schema: Schema, root: str) -> list[Mutation[bytes]]:
    """Return every mutation of a valid body that is invalid on the wire.

    Args:
        value: a valid one.
        schema: of the body.
        root: name of the root element.
    """
    made = [*_of_document(value, root), *_of_places(value, schema, root)]
    return [item for item in made if _is_invalid(item.made, schema, root)]


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


def _of_places(value: Any, schema: Schema, root: str) -> Iterator[Mutation[bytes]]:
    for place in places(value, schema):
        write = _writer(value, place, root)
        if isinstance(place.value, dict):
            yield from place.members_broken(write)
            if place.path:
                yield Mutation("type", f"text at {place.where}", write("stop"))
        elif place.is_number:
            for text in _NO_NUMBERS:
                named = (place.field, text) if text == STRANGE_TEXT else ()
                yield Mutation("lexical", f"{text or 'nothing'!r} at {place.where}", write(text), *named)
            yield Mutation("type", f"an element at {place.where}", write({STRANGE_NAME: 0}))


def _writer(value: Any, place: Place, root: str) -> Callable[[Any], bytes]:
    """Return a function that writes the whole value with another one at a place."""
    return lambda new: xml_bytes(replaced(value, place.path, new), root)


def _is_invalid(body: bytes, schema: Schema, root: str) -> bool:
    """Return whether a body breaks the contract, read as the contract reads XML."""
    try:
        element = parse_xml(body)
    except UnreadableError:
        return True
    if local_name(element) != root or STRANGE_NAME.encode() in body:
        return True
    value = from_element(element, schema)
    return not shape_of(schema).holds(value) or any(abs(item) == float("inf") for item in numbers_in(value))
