"""Requests made from the contract's examples and adapted to the robot."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from conformance.api.rest.inputs import NOTHING, Inputs, request_of
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.samples import sample
from conformance.api.rest.validity import require_valid
from conformance.documents.files import file_of, is_made
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import SAFE, Operation
from conformance.transport.exchange import Exchange, Outgoing

JSON = "application/json"
XML = "application/xml"
# A refused request is repeated if its Retry-After is no longer than this, s.
_MOMENT_S = 2


@dataclass(frozen=True)
class Call:
    """One request for an operation.

    Attributes:
        operation: the operation.
        inputs: its values.
        octets: bytes that are sent in place of the body's value; None if the value is sent.
    """

    operation: Operation
    inputs: Inputs = field(default_factory=Inputs)
    octets: bytes | None = None

    @cached_property
    def outgoing(self) -> Outgoing:
        """The request as it is sent."""
        inputs = self.inputs if self.octets is None else replace(self.inputs, body=self.octets)
        return request_of(self.operation, inputs)

    @property
    def path(self) -> str:
        """The request target below the base URL, with its query."""
        return self.outgoing.target

    @property
    def media_type(self) -> str:
        """The media type of the body; empty without one."""
        return self.outgoing.content_type

    @property
    def body(self) -> bytes:
        """The bytes of the body."""
        return self.outgoing.body

    @property
    def value(self) -> Any:
        """The value in the body, or None."""
        return None if self.inputs.body is NOTHING else self.inputs.body

    @property
    def bare(self) -> Call:
        """The request without a body."""
        return Call(self.operation, replace(self.inputs, body=NOTHING, media_type=""))

    def having(self, name: str, text: str | None) -> Call:
        """Return the request with another text for a parameter, or without the parameter."""
        where = "path" if name in {item.name for item in self.operation.parameter("path")} else "query"
        return replace(self, inputs=self.inputs.having(where, name, NOTHING if text is None else text))

    def carrying(self, body: bytes) -> Call:
        """Return the request with another body, valid or not."""
        return replace(self, octets=body)

    def rewritten(self, api: RestInterface, body: bytes) -> Call:
        """Return the request with another valid body.

        Raises:
            HarnessError: the body is invalid by the contract.
        """
        require_valid(api.run.contract, self.operation.method, self.path, self.media_type, body)
        return self.carrying(body)

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


def example_call(api: RestInterface, operation: Operation, media_type: str = JSON) -> Call:
    """Return a valid request for an operation, made from the contract's examples.

    Optional query parameters are included if the contract has an example of them.

    Args:
        api: the robot's REST interface.
        operation: the operation.
        media_type: the media type of the body, if the operation has one.

    Raises:
        HarnessError: the generated request is invalid by the contract.
    """
    items = [item for where in ("path", "query") for item in operation.parameter(where)]
    given = {
        item.name: item.examples[0] if item.examples else sample(item.schema)
        for item in items
        if item.required or item.examples
    }
    given = _fit(api, operation, given) if given else {}
    inputs = Inputs()
    for item in items:
        inputs = inputs.having(item.where, item.name, given[item.name]) if item.name in given else inputs
    if media_type in operation.bodies:
        body = operation.bodies.get(JSON) or next(iter(operation.bodies.values()))
        plain = [item for item in body.examples if not isinstance(item, str)]
        value = _fit(api, operation, plain[0] if plain else sample(body.schema))
        value = file_of(media_type) if is_made(media_type) else value
        inputs = replace(inputs, media_type=media_type, body=value)
    call = Call(operation, inputs)
    require_valid(api.run.contract, operation.method, call.path, call.media_type, call.body)
    return call


def root_name(schema: Schema) -> str:
    """Return the name of a schema's XML element; empty without one."""
    return str(schema.get("xml", {}).get("name", ""))


def _fit(api: RestInterface, operation: Operation, value: Any) -> Any:
    """Return a value adapted to this robot: within its limits, near its position."""
    return api.device.fit(api, operation.id, value)
