"""Read and write the parameters and members of bodies in requests for a described operation.

The operators for members of responses: each makes a value that a schema of the usual kinds forbids.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qsl, quote, unquote, urlencode

from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.representation import flat
from proof.mutation.messages import Request
from proof.selftest.generated.operators import OPERATORS
from proof.selftest.generated.places import Exchange, Place
from proof.selftest.generated.slots import Edit, Slot, same

#: Stands for a value that is not there.
NOTHING = object()
_DEPTH = 3
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class Input:
    """A parameter or member of a body.

    Attributes:
        where: path, query or body.
        steps: its name, after those of the objects that hold it.
        schema: of its value, flattened.
        required: whether requests must have it.
    """

    where: str
    steps: tuple[str, ...]
    schema: Schema
    required: bool

    @property
    def label(self) -> str:
        """Return its part of a mutant's name."""
        return f"{self.where}.{'.'.join(self.steps)}"

    def read(self, exchange: Exchange, request: Request) -> Any:
        """Return the value in a request as its schema has it; NOTHING where it is not there or cannot be read."""
        if self.where == "body":
            holder = self._holder(_body(request))
            return holder.get(self.steps[-1], NOTHING) if holder is not None else NOTHING
        text = self._texts(exchange, request).get(self.steps[0])
        return NOTHING if text is None else _value(self.schema, text)

    def written(self, exchange: Exchange, request: Request, value: Any) -> Request:
        """Return the request with another value; NOTHING leaves it out."""
        if self.where == "body":
            whole = _body(request)
            holder = self._holder(whole)
            if holder is not None:
                holder.pop(self.steps[-1], None)
                if value is not NOTHING:
                    holder[self.steps[-1]] = value
            return request.copy(body=json.dumps(whole).encode())
        text = value if isinstance(value, str) else "" if value is NOTHING else json.dumps(value)
        if self.where == "query":
            pairs = [
                (key, item) for key, item in parse_qsl(request.query, keep_blank_values=True) if key != self.steps[0]
            ]
            pairs += [(self.steps[0], text)] if value is not NOTHING else []
            return request.copy(target=request.path + (f"?{urlencode(pairs)}" if pairs else ""))
        found = re.fullmatch(exchange.path, request.path)
        number = exchange.parameters.index(self.steps[0]) + 1
        if found is None or value is NOTHING:
            return request
        path = request.path[: found.start(number)] + quote(text, safe="") + request.path[found.end(number) :]
        return request.copy(target=path + (f"?{request.query}" if request.query else ""))

    def there(self, request: Request) -> bool:
        """Return whether the object that holds it is in a request."""
        return self.where != "body" or self._holder(_body(request)) is not None

    def _holder(self, value: Any) -> dict[str, Any] | None:
        for step in self.steps[:-1]:
            value = value.get(step) if isinstance(value, dict) else None
        return value if isinstance(value, dict) else None

    def _texts(self, exchange: Exchange, request: Request) -> dict[str, str]:
        if self.where == "query":
            return dict(parse_qsl(request.query, keep_blank_values=True))
        found = re.fullmatch(exchange.path, request.path)
        return {
            name: unquote(text)
            for name, text in zip(exchange.parameters, found.groups() if found else (), strict=False)
        }


def _body(request: Request) -> Any:
    try:
        return json.loads(request.body) if request.media_type.endswith("json") else None
    except (ValueError, RecursionError):
        return None


def _value(schema: Schema, text: str) -> Any:
    """Return what the text of a parameter stands for."""
    kinds = kinds_of(schema)
    if kinds & {"integer", "number"} and _NUMBER.fullmatch(text):
        number = float(text)
        return int(text) if text.lstrip("-").isdigit() else number
    if "boolean" in kinds and text in {"true", "false"}:
        return text == "true"
    return text


def inputs_of(operation: Operation) -> Iterator[Input]:
    """Yield the parameters in path and query that are scalars, and the members of a JSON body."""
    for item in operation.parameters:
        kinds = kinds_of(item.schema)
        if item.where in {"path", "query"} and kinds and not kinds & {"object", "array"}:
            yield Input(item.where, (item.name,), flat(item.schema), item.required)
    for name, body in operation.bodies.items():
        if is_json(name):
            yield from _members(body.schema, ())
            return


def _members(schema: Schema, steps: tuple[str, ...]) -> Iterator[Input]:
    schema = flat(schema)
    for name, part in schema.get("properties", {}).items():
        flatter = flat(part)
        if not flatter.get("readOnly"):
            yield Input("body", (*steps, name), flatter, name in schema.get("required", ()))
            if kinds_of(flatter) == {"object"} and len(steps) < _DEPTH:
                yield from _members(flatter, (*steps, name))


@dataclass(frozen=True)
class FieldOperator:
    """One way to alter a member.

    Attributes:
        name: first part of the names of its mutants.
        says: the effect, as a clause about the member.
        make: makes the edit of a place with a schema.
    """

    name: str
    says: str
    make: Callable[[Place, Schema], Edit]


def _put(value_of: Callable[[Schema, Any], Any]) -> Callable[[Place, Schema], Edit]:
    """Return an edit that puts in a value made from the schema and the present value, or None to alter nothing."""

    def make(_place: Place, schema: Schema) -> Edit:
        flatter = flat(schema)

        def edit(slots: list[Slot]) -> bool:
            altered = False
            for slot in slots:
                before = slot.value()
                after = value_of(flatter, before)
                if after is not None and not same(before, after):
                    slot.put(after)
                    altered = True
            return altered

        return edit

    return make


def _above(schema: Schema, _value: Any) -> Any:
    bound = schema.get("maximum", schema.get("exclusiveMaximum"))
    return bound + 1 if isinstance(bound, int | float) and not isinstance(bound, bool) else None


def _below(schema: Schema, _value: Any) -> Any:
    bound = schema.get("minimum", schema.get("exclusiveMinimum"))
    return bound - 1 if isinstance(bound, int | float) and not isinstance(bound, bool) else None


def _long(schema: Schema, value: Any) -> Any:
    if isinstance(schema.get("maxLength"), int) and schema["maxLength"] <= 1 << 16:
        return "a" * (schema["maxLength"] + 1)
    if isinstance(schema.get("maxItems"), int) and isinstance(value, list) and value:
        return [value[0]] * (schema["maxItems"] + 1)
    return None


def _empty(schema: Schema, value: Any) -> Any:
    if isinstance(value, str) and (schema.get("minLength") or "pattern" in schema or "format" in schema):
        return ""
    return [] if isinstance(value, list) and schema.get("minItems") else None


def _item(_schema: Schema, value: Any) -> Any:
    return [*value[:-1], {"roaas": "x"}] if isinstance(value, list) and value else None


def _usual(name: str) -> FieldOperator:
    found = next(one for one in OPERATORS if one.name == name and "json" in one.media)
    return FieldOperator(name, found.says, lambda place, _schema: found.make(place))


FIELD_OPERATORS = (
    *(_usual(name) for name in ("drop", "null", "retype", "rename", "comma")),
    FieldOperator(
        "enum", "is none of the declared values", _put(lambda schema, _: "roaas" if "enum" in schema else None)
    ),
    FieldOperator(
        "format",
        "has not the declared format",
        _put(lambda schema, _: "roaas 17" if {"format", "pattern"} & schema.keys() else None),
    ),
    FieldOperator("above", "is above its maximum", _put(_above)),
    FieldOperator("below", "is below its minimum", _put(_below)),
    FieldOperator("long", "is longer than its maximum", _put(_long)),
    FieldOperator("empty", "is empty", _put(_empty)),
    FieldOperator("fraction", "is no whole number", _put(lambda _, value: value + 0.5 if type(value) is int else None)),
    FieldOperator("wrap", "is in a list", _put(lambda _, value: [value])),
    FieldOperator("item", "has an item of another type", _put(_item)),
)
