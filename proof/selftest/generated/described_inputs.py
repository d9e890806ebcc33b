"""Read and write the parameters and members of bodies in requests for a described operation."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qsl, quote, unquote, urlencode

from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.representation import flat
from proof.mutation.messages import Request
from proof.selftest.generated.places import Exchange

#: NOTHING: stands for a missing value.
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

    def write(self, exchange: Exchange, request: Request, value: Any) -> Request:
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
    """Return the value of a parameter's text."""
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
