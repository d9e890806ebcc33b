"""How the calls of a motion map become requests, and responses become values: JSON over HTTP, or SOAP by a WSDL."""

from __future__ import annotations

import json
import re
from typing import Any, Final, Protocol

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import INVALID, validity
from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json, matching
from conformance.documents.writing import form_body, multipart_body, xml_bytes
from conformance.documents.wsdl import SoapOperation, SoapPort
from conformance.documents.wsdl_pack import each, label_of
from conformance.documents.xml import Node, NotXmlError, elements, local, parse
from conformance.documents.xsd_shapes import NoElementError, node_of, value_of
from conformance.scenarios.described_messages import DescribedMessages, fields_of, target_of
from conformance.transport.client import Headers
from conformance.transport.exchange import Outgoing

_FORM: Final = "application/x-www-form-urlencoded"
_MULTIPART: Final = "multipart/form-data"
_NUMBER: Final = re.compile(r"-?\d+\.\d+(e-?\d+)?")


class Binding(Protocol):
    """One way to call a device.

    Attributes:
        syntax: the syntax of its messages.
    """

    syntax: str

    @property
    def has_credentials(self) -> bool:
        """Whether a request can be sent without the credentials that the device wants."""

    def make(
        self, call: str, body: Any, media_type: str = JSON, root: str = "", *, authorized: bool = True
    ) -> Outgoing:
        """Return the request of a call with this body; None means without one, or with the usual one.

        Args:
            call: the operation.
            body: its values.
            media_type: in which they are written; a SOAP message is XML.
            root: the name of the root element, of XML.
            authorized: whether the credentials are sent.
        """

    def content(self, octets: bytes) -> Any:
        """Return the value in a response's body, or None if it cannot be read."""

    def forbids(self, call: str, body: Any) -> bool:
        """Return whether the device's description forbids a call."""


class JsonBinding:
    """JSON over HTTP."""

    syntax = "JSON"

    def __init__(self, api: RestInterface | None, contract: Contract | None = None) -> None:
        self._api, self._contract = api, contract

    @classmethod
    def of(cls, contract: Contract) -> JsonBinding:
        """Return the binding of a description, without a device."""
        return cls(None, contract)

    @property
    def has_credentials(self) -> bool:
        """Whether the connection has any."""
        return self._api is not None and bool(self._api.client.connection.credentials.items)

    def make(
        self,
        call: str,
        body: Any,
        media_type: str = JSON,
        root: str = "",
        *,
        authorized: bool = True,  # noqa: ARG002 - the client leaves them out
    ) -> Outgoing:
        """Return the request of a call."""
        method, _, path = call.partition(" ")
        fields: Headers = (("Accept", "application/json"),) if body is None and method == "GET" else ()
        declared = matching(self._contract, method, path.partition("?")[0]) if self._contract else None
        path = _with_whole_numbers(path, declared) if declared else path
        if body is None:
            return Outgoing(method, path, fields, b"")
        media_type = _declared_type(media_type, declared)
        given = declared.bodies.get(media_type) if declared else None
        body = _whole(body, given.schema) if given else body
        if root:
            written = xml_bytes(body, root)
        elif media_type == _MULTIPART:
            media_type, written = multipart_body(body, given.encoding if given else None)
        elif media_type == _FORM:
            written = form_body(body, given.encoding if given else {})
        else:
            written = json.dumps(body).encode()
        return Outgoing(method, path, (("Content-Type", media_type),), written)

    def content(self, octets: bytes) -> Any:
        """Return the JSON of a body."""
        return read_json(octets).value

    def forbids(self, call: str, body: Any) -> bool:
        """Return whether the OpenAPI description forbids a call."""
        if self._contract is None:
            return False
        one = self.make(call, body)
        return validity(self._contract, one.method, one.target, one.content_type, one.body).verdict == INVALID


def _declared_type(wanted: str, declared: Operation | None) -> str:
    """Return the media type in which a body is written: never JSON where the description has a form in its place."""
    if wanted != JSON or declared is None or not declared.bodies or any(map(is_json, declared.bodies)):
        return wanted
    return next((name for name in (_FORM, _MULTIPART) if name in declared.bodies), wanted)


def _with_whole_numbers(path: str, declared: Operation) -> str:
    """Return a path with whole numbers where the description has integers."""
    whole = {
        f"{{{parameter.name}}}" for parameter in declared.parameter("path") if kinds_of(parameter.schema) == {"integer"}
    }
    parts, names = path.split("/"), declared.template.split("/")
    if not whole or len(parts) != len(names):
        return path
    return "/".join(
        str(round(float(part))) if name in whole and _NUMBER.fullmatch(part) else part
        for part, name in zip(parts, names, strict=True)
    )


def _whole(value: Any, schema: Schema) -> Any:
    """Return a value with whole numbers where its schema has integers: no map has another way to write them."""
    if isinstance(value, float) and kinds_of(schema) == {"integer"}:
        return round(value)
    if isinstance(value, list) and isinstance(schema.get("items"), dict):
        return [_whole(item, schema["items"]) for item in value]
    if not isinstance(value, dict):
        return value
    members: dict[str, Schema] = {}
    for part in (schema, *(item for key in ("allOf", "anyOf", "oneOf") for item in schema.get(key, ()))):
        members = {**part.get("properties", {}), **members} if isinstance(part, dict) else members
    return {
        name: _whole(one, members[name]) if isinstance(members.get(name), dict) else one for name, one in value.items()
    }


class SoapBinding:
    """SOAP by a WSDL; parts of a message that the map does not name come from [values], or are usual values."""

    syntax = "XML"

    def __init__(self, api: RestInterface, messages: DescribedMessages) -> None:
        self._api, self._messages = api, messages
        self._operations = {label_of(port, one): (port, one) for port, one in each(messages.found.ports)}
        self._usual: dict[str, Node | None] = {}

    @property
    def has_credentials(self) -> bool:
        """Whether messages carry a token, or the connection has any."""
        return self._messages.token is not None or bool(self._api.client.connection.credentials.items)

    def make(
        self, call: str, body: Any, _media_type: str = "", _root: str = "", *, authorized: bool = True
    ) -> Outgoing:
        """Return the message of a call, with its values in the order of the schema.

        Raises:
            NoElementError: a value has no place in the message.
            NotPossibleError: no schema declares the message.
        """
        port, operation, node = self._node(call, body)
        message = self._messages.message(port, operation, node, authorized=authorized)
        return Outgoing("POST", target_of(port), fields_of(port, operation), message)

    def _node(self, call: str, body: Any) -> tuple[SoapPort, SoapOperation, Node | None]:
        port, operation = self._operations[call]
        if body is None:
            if call not in self._usual:
                self._usual[call] = self._messages.usual(operation)[1]
            return port, operation, self._usual[call]
        declared = self._messages.found.types.shape(operation.request)
        if declared is None:
            raise NoElementError(f"no schema declares the message of {operation.name}")
        return port, operation, node_of(declared, body)

    def content(self, octets: bytes) -> Any:
        """Return the content of the Body's first element, without namespaces in its names."""
        try:
            parts = [element for element in elements(parse(octets)) if local(str(element.tag)) == "Body"]
        except NotXmlError:
            return None
        return next((value_of(element) for part in parts for element in elements(part)), None)

    def forbids(self, call: str, body: Any) -> bool:
        """Return whether the schema forbids a message."""
        try:
            node = self._node(call, body)[2]
        except NoElementError:
            return False  # no such message can be made from the schema
        return node is not None and bool(self._messages.found.types.invalid(parse(node.serialize())))


def binding_of(api: RestInterface) -> Binding:
    """Return how a device is called: by its WSDL if it has one.

    Raises:
        NotPossibleError, NoAnswerError: see DescribedMessages.of().
    """
    messages = DescribedMessages.of(api)
    return JsonBinding(api, api.run.contract) if messages is None else SoapBinding(api, messages)
