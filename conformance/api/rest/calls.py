"""Requests made from the contract's examples and adapted to the robot."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import quote

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.samples import sample
from conformance.api.rest.validity import require_valid
from conformance.documents.files import file_of, is_made
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import SAFE, Operation, is_json
from conformance.documents.parameters import Parameter
from conformance.documents.writing import json_text, path_text, query_pairs, query_text, text_of, xml_bytes
from conformance.transport.exchange import Exchange

JSON = "application/json"
XML = "application/xml"
# A refused request is repeated if its Retry-After is no longer than this, s.
_MOMENT_S = 2


@dataclass(frozen=True)
class Call:
    """One request for an operation.

    Attributes:
        operation: the operation.
        values: of path and query parameters by name, not percent-encoded: texts, lists and objects.
        media_type: of the body; empty without one.
        body: bytes.
        value: the value in the body, or None.
    """

    operation: Operation
    values: dict[str, Any]
    media_type: str = ""
    body: bytes = b""
    value: Any = None

    @property
    def path(self) -> str:
        """The request target below the base URL, with its query."""
        path = self.operation.template
        for item in self.operation.parameter("path"):
            text = path_text(self.values.get(item.name, ""), item.style, item.name, explode=item.explode)
            path = path.replace(f"{{{item.name}}}", text)
        query = "&".join(
            _query_of(item, self.values[item.name])
            for item in self.operation.parameter("query")
            if item.name in self.values
        )
        return f"{path}?{query}" if query else path

    def having(self, name: str, text: str | None) -> Call:
        """Return the request with another text for a parameter, or without the parameter."""
        values = {key: item for key, item in self.values.items() if key != name}
        return replace(self, values=values if text is None else {**values, name: text})

    def carrying(self, body: bytes) -> Call:
        """Return the request with another body, valid or not."""
        return replace(self, body=body)

    def rewritten(self, api: RestInterface, body: bytes) -> Call:
        """Return the request with another valid body.

        Raises:
            HarnessError: the body is invalid by the contract.
        """
        require_valid(api.run.contract, self.operation.method, self.path, self.media_type, body)
        return replace(self, body=body)

    def send(
        self, api: RestInterface, *headers: tuple[str, str], method: str | None = None, fresh: bool = False
    ) -> Exchange:
        """Send the request. A read that the robot defers by Retry-After is repeated, a few times per run.

        Raises:
            NoAnswerError: no HTTP response was received.
        """
        fields = list(headers)
        names = {name.lower() for name, _ in fields}
        if self.media_type and "content-type" not in names:
            fields.append(("Content-Type", self.media_type))
        asked = method or self.operation.method
        sent = [pair for pair in fields if pair != ("Content-Type", "")]
        exchange = api.client.send(asked, self.path, headers=sent, body=self.body, fresh=fresh)
        after = exchange.response.put_off_s
        if asked not in SAFE or after is None or after > _MOMENT_S or api.waits <= 0:
            return exchange
        api.waits -= 1
        time.sleep(after)
        return api.client.send(asked, self.path, headers=sent, body=self.body, fresh=fresh)


def _query_of(item: Parameter, value: Any) -> str:
    """Return a query parameter, percent-encoded."""
    if isinstance(value, list | dict):
        return query_text(query_pairs(item.name, value, item.style, explode=item.explode))
    return f"{quote(item.name, safe='')}={quote(value, safe='')}"


def value_text(item: Parameter, value: Any) -> Any:
    """Return a parameter's value as a call has it: JSON for a parameter with content, else as text."""
    if is_json(item.media_type):
        return json_text(value)
    return value if isinstance(value, list | dict) else text_of(value)


def example_call(api: RestInterface, operation: Operation, media_type: str = JSON) -> Call:
    """Return a valid request for an operation, made from the contract's examples.

    Optional query parameters are included if the contract has an example of them.

    Args:
        api: the robot's REST interface.
        operation: the operation.
        media_type: of the body, if the operation has one.

    Raises:
        HarnessError: the generated request is invalid by the contract.
    """
    call = _example(api, operation, media_type)
    require_valid(api.run.contract, operation.method, call.path, call.media_type, call.body)
    return call


def _example(api: RestInterface, operation: Operation, media_type: str) -> Call:
    given: dict[str, Any] = {}
    for item in operation.parameters:
        if item.where in {"path", "query"} and (item.required or item.examples):
            given[item.name] = item.examples[0] if item.examples else sample(item.schema)
    if given:
        given = _fit(api, operation, given)
    by_name = {item.name: item for item in operation.parameters if item.where in {"path", "query"}}
    call = Call(operation, {name: value_text(by_name[name], value) for name, value in given.items()})
    if media_type not in operation.bodies:
        return call
    body = operation.bodies.get(JSON) or next(iter(operation.bodies.values()))
    plain = [item for item in body.examples if not isinstance(item, str)]
    value = _fit(api, operation, plain[0] if plain else sample(body.schema))
    if is_made(media_type):
        octets = file_of(media_type)
    elif media_type == XML:
        octets = xml_bytes(value, root_name(operation.bodies[XML].schema) or "value")
    else:
        octets = json_text(value).encode()
    return replace(call, media_type=media_type, body=octets, value=value)


def root_name(schema: Schema) -> str:
    """Return the name of a schema's XML element; empty without one."""
    return str(schema.get("xml", {}).get("name", ""))


def _fit(api: RestInterface, operation: Operation, value: Any) -> Any:
    """Return a value adapted to this robot: within its limits, near its position."""
    return api.device.fit(api, operation.id, value)
