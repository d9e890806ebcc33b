"""Named mutations of a valid XML body: each breaks the contract in one way, at one place."""

from collections.abc import Iterator
from typing import Any

from conformance.api.rest.mutations import STRANGE_NAME, STRANGE_TEXT, places, replaced
from conformance.documents.json_schema import Schema, numbers_in, shape_of, types_of
from conformance.documents.representation import UnreadableError, from_element, local_name, parse_xml
from conformance.documents.writing import Pairs, Token, xml_bytes

_NO_NUMBERS = (STRANGE_TEXT, "NaN", "INF", "-INF", "Infinity", "1e400", "", "0.1 0.2", "1,5")


def xml_mutations(value: Any, schema: Schema, root: str) -> list[tuple[str, bytes]]:
    """Names and octets of invalid bodies, confirmed to be invalid as they are sent.

    Args:
        value: a valid one.
        schema: of the body.
        root: name of the root element.
    """
    found = [*_of_document(value, root), *_of_places(value, schema, root)]
    return [(name, body) for name, body in found if _is_invalid(body, schema, root)]


def _of_document(value: Any, root: str) -> Iterator[tuple[str, bytes]]:
    valid = xml_bytes(value, root)
    yield "no octets", b""
    yield "XML cut short", valid[: -len(root) - 1]
    yield "an end tag without a start", valid + f"</{root}>".encode()
    yield "JSON as XML", b'{"x": 0.1}'
    yield "another root element", xml_bytes(value, STRANGE_NAME)
    yield "an empty root element", f"<{root}/>".encode()
    yield "text in the root element", f"<{root}>stop</{root}>".encode()


def _of_places(value: Any, schema: Schema, root: str) -> Iterator[tuple[str, bytes]]:
    for place in places(value, schema):
        if isinstance(place.value, dict):
            members = place.value
            for name in place.schema.get("required", ()):
                rest = {key: item for key, item in members.items() if key != name}
                yield f"{name} missing at {place.where}", xml_bytes(replaced(value, place.path, rest), root)
            strange = {**members, STRANGE_NAME: 0}
            yield f"an unknown element at {place.where}", xml_bytes(replaced(value, place.path, strange), root)
            for name, item in members.items():
                twice = Pairs((*members.items(), (name, item)))
                yield f"{name} twice at {place.where}", xml_bytes(replaced(value, place.path, twice), root)
            if place.path:
                yield f"text at {place.where}", xml_bytes(replaced(value, place.path, "stop"), root)
        elif set(types_of(place.schema)) & {"number", "integer"}:
            for text in _NO_NUMBERS:
                body = xml_bytes(replaced(value, place.path, Token(text)), root)
                yield f"{text or 'nothing'!r} at {place.where}", body
            nested = {STRANGE_NAME: 0}
            yield f"an element at {place.where}", xml_bytes(replaced(value, place.path, nested), root)


def _is_invalid(body: bytes, schema: Schema, root: str) -> bool:
    """Whether what is sent breaks the contract, read as the contract reads XML."""
    try:
        element = parse_xml(body)
    except UnreadableError:
        return True
    if local_name(element) != root or b"roaas_unknown" in body:
        return True
    value = from_element(element, schema)
    return bool(shape_of(schema).problem(value)) or any(abs(item) == float("inf") for item in numbers_in(value))
