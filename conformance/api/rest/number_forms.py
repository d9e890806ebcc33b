"""Equivalent JSON with numbers in another notation, and with integers at the ends of their range."""

from collections.abc import Callable, Iterator
from typing import Any

from conformance.api.rest.json_mutations import places, replaced, with_options
from conformance.documents.json_schema import Schema
from conformance.documents.writing import Token, json_text

_INT32_ENDS = (-(2**31), 2**31 - 1)


def with_numbers(value: Any, write: Callable[[float], str]) -> bytes:
    """Return JSON with floats written by ``write``; integers and texts stay unchanged."""

    def written(item: Any) -> Any:
        if isinstance(item, dict):
            return {name: written(part) for name, part in item.items()}
        if isinstance(item, list):
            return [written(part) for part in item]
        return Token(write(item)) if isinstance(item, float) else item

    return json_text(written(value)).encode()


def at_integer_ends(value: Any, schema: Schema) -> Iterator[Any]:
    """Yield the value with each int32 of its optional members at the minimum and maximum."""
    for whole, part in with_options(value, schema):
        for place in places(part.value, part.schema, part.path):
            if (place.schema.get("minimum"), place.schema.get("maximum")) == _INT32_ENDS:
                yield from (replaced(whole, place.path, end) for end in _INT32_ENDS)
