"""The inputs of one request for an operation, and the request that they make."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final

from conformance.api.rest.samples import sample
from conformance.api.rest.validity import validity_by
from conformance.api.rest.values import Values
from conformance.documents.files import file_of, is_made
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import Body, Operation, is_json, is_xml
from conformance.documents.parameter_reading import is_binary
from conformance.documents.parameters import Parameter
from conformance.documents.writing import (
    form_body,
    header_text,
    json_text,
    multipart_body,
    path_text,
    query_pairs,
    query_text,
    xml_bytes,
)
from conformance.transport.exchange import Outgoing

FORM: Final = "application/x-www-form-urlencoded"
MULTIPART: Final = "multipart/form-data"


class _Nothing:
    """The type of NOTHING."""


#: Marks a request without a body; None is the JSON value null.
NOTHING: Final = _Nothing()


@dataclass(frozen=True)
class Inputs:
    """The values of one request, before they are written.

    Attributes:
        path, query, headers, cookies: values by the parameter's name.
        body: JSON value of the body, bytes to send as they are, or NOTHING.
        media_type: the media type of the body; empty without one.
        accept: value of Accept; empty means any format.
    """

    path: dict[str, Any] = field(default_factory=dict)
    query: dict[str, Any] = field(default_factory=dict)
    headers: dict[str, Any] = field(default_factory=dict)
    cookies: dict[str, Any] = field(default_factory=dict)
    body: Any = NOTHING
    media_type: str = ""
    accept: str = ""

    def at(self, where: str) -> dict[str, Any]:
        """Return the values of one place: path, query, header or cookie."""
        return {"path": self.path, "query": self.query, "header": self.headers, "cookie": self.cookies}[where]

    def having(self, where: str, name: str, value: Any) -> Inputs:
        """Return the inputs with another value of a parameter; NOTHING leaves the parameter out."""
        values = {key: item for key, item in self.at(where).items() if key != name}
        if value is not NOTHING:
            values[name] = value
        changed: dict[str, Any] = {{"header": "headers", "cookie": "cookies"}.get(where, where): values}
        return replace(self, **changed)


def request_of(operation: Operation, inputs: Inputs) -> Outgoing:
    """Return the request that carries the inputs (OpenAPI 3.1, 4.8.12.2: styles of parameters)."""
    path, query, headers = operation.template, [], [("Accept", inputs.accept)] if inputs.accept else []
    cookies = []
    for item in operation.parameters:
        values = inputs.at(item.where)
        if item.name not in values:
            continue
        # A parameter with `content` is written in its media type, whatever its style.
        value = json_text(values[item.name]) if is_json(item.media_type) else values[item.name]
        match item.where:
            case "path":
                text = path_text(value, item.style, item.name, explode=item.explode)
                path = path.replace(f"{{{item.name}}}", text)
            case "query":
                query += query_pairs(item.name, value, item.style, explode=item.explode)
            case "header":
                headers.append((item.name, header_text(value, item.style, explode=item.explode)))
            case _:
                cookies += query_pairs(item.name, value, "form", explode=item.explode)
    known = {item.name for item in operation.parameters}
    reserved = frozenset(item.name for item in operation.parameter("query") if item.reserved)
    query += [pair for name, value in inputs.query.items() if name not in known for pair in query_pairs(name, value)]
    if cookies:
        headers.append(("Cookie", "; ".join(f"{name}={text}" for name, text in cookies)))
    content_type, body = _body(operation, inputs)
    target = f"{path}?{query_text(query, reserved)}" if query else path
    return Outgoing.of(operation.method, target, content_type, body, tuple(headers))


def _body(operation: Operation, inputs: Inputs) -> tuple[str, bytes]:
    """Return the Content-Type and the bytes of the body."""
    value, media_type = inputs.body, inputs.media_type
    if value is NOTHING:
        media_type, value = "", b""
    if isinstance(value, bytes):
        return media_type, value
    encoding = operation.bodies[media_type].encoding if media_type in operation.bodies else {}
    if media_type == FORM and isinstance(value, dict):
        return media_type, form_body(value, encoding)
    if media_type == MULTIPART and isinstance(value, dict):
        return multipart_body(value, encoding)
    if is_xml(media_type):
        schema = operation.bodies[media_type].schema if media_type in operation.bodies else {}
        return media_type, xml_bytes(value, str(schema.get("xml", {}).get("name", "root")))
    if is_json(media_type) or not isinstance(value, str):
        return media_type, json_text(value).encode()
    return media_type, value.encode()


def parameter_verdict(operation: Operation, parameter: Parameter, value: Any) -> str:
    """Return whether a parameter's text is valid, invalid or unclear; with NOTHING, whether leaving it out is."""
    alone = replace(operation, parameters=(parameter,), bodies={})
    return _verdict(alone, Inputs().having(parameter.where, parameter.name, value))


def body_verdict(operation: Operation, inputs: Inputs) -> str:
    """Return whether a request body's bytes are valid, invalid or unclear."""
    return _verdict(replace(operation, parameters=()), inputs)


def _verdict(operation: Operation, inputs: Inputs) -> str:
    request = request_of(operation, inputs)
    path, _, query = request.target.partition("?")
    return validity_by(operation, path, query, request.content_type, request.body, request.headers).verdict


def usual_inputs(operation: Operation, values: Values) -> list[Inputs]:
    """Return inputs of valid requests with only the required parameters and members, the most promising first."""
    base = Inputs()
    chosen = [(item, values.of(operation, item)) for item in operation.parameters if item.required]
    for item, known in chosen:
        if known:
            base = base.having(item.where, item.name, known[0])
    bodies: list[tuple[str, Any]] = []
    for name, body in list(operation.bodies.items())[:1] if operation.bodies else []:
        found = values.body(body.schema, body.examples, operation)
        found = [values.unique.with_new_values(operation, value, body.schema) for value in found]
        bodies = [(name, _with_files(value, body, name)) for value in found]
    if bodies:
        base = replace(base, media_type=bodies[0][0], body=bodies[0][1])
    found = [base]
    for item, known in chosen:
        found += [base.having(item.where, item.name, one) for one in known[1:]]
    found += [replace(base, body=value) for _, value in bodies[1:]]
    return found


def _with_files(value: Any, body: Body, media_type: str) -> Any:
    """Return a form's value with bytes where the schema asks for a file; a file if the whole body must be one."""
    if is_made(media_type):
        return file_of(media_type)
    if media_type != MULTIPART or not isinstance(value, dict):
        return value
    properties = body.schema.get("properties", {})
    files = {name: part for name, part in properties.items() if name in value and is_binary(part)}
    return value | {name: file_of(_type_of_part(name, part, body)) for name, part in files.items()}


def _type_of_part(name: str, part: Schema, body: Body) -> str:
    """Return the first media type that a description gives a part of a form; empty without one."""
    given = body.encoding[name].media_type if name in body.encoding else ""
    return (given or str(part.get("contentMediaType", ""))).partition(",")[0].partition(";")[0].strip()


def with_new_values(operation: Operation, inputs: Inputs, values: Values, place: str = "") -> Inputs:
    """Return the inputs of a creation with new unique values, except for the member at a place."""
    if operation.method != "POST" or inputs.media_type not in operation.bodies:
        return inputs
    schema, keep = operation.bodies[inputs.media_type].schema, place.removeprefix("body /")
    return replace(inputs, body=values.unique.with_new_values(operation, inputs.body, schema, keep=keep))


def whole_body(operation: Operation, values: Values) -> tuple[str, Any]:
    """Return the media type and a body with all optional members; an empty media type without a body."""
    for name, body in operation.bodies.items():
        whole = values.fill(sample(body.schema, whole=True), body.schema, operation)
        whole = values.unique.with_new_values(operation, whole, body.schema)
        return name, _with_files(whole, body, name)
    return "", NOTHING
