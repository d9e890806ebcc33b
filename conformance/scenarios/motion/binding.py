"""How the calls of a motion map become requests, and responses become values: JSON over HTTP, or SOAP by a WSDL."""

from __future__ import annotations

import json
from typing import Any, Protocol
from urllib.parse import urlencode

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import INVALID, validity
from conformance.documents.json_text import read_json
from conformance.documents.writing import xml_bytes
from conformance.documents.wsdl import SoapOperation, SoapPort
from conformance.documents.wsdl_pack import each, label_of
from conformance.documents.xml import NotXmlError, elements, parse
from conformance.documents.xml_names import local
from conformance.documents.xml_node import Node
from conformance.documents.xml_values import NoElementError, node_of, value_of
from conformance.scenarios.described_messages import DescribedMessages, fields_of, target_of
from conformance.transport.client import Headers
from conformance.transport.exchange import Outgoing


class Binding(Protocol):
    """One way to call a device.

    Attributes:
        syntax: that of its messages.
    """

    syntax: str

    @property
    def has_credentials(self) -> bool:
        """Whether a request can be sent without the credentials that the device wants."""

    def made(
        self, call: str, body: Any, media_type: str = JSON, root: str = "", *, authorized: bool = True
    ) -> Outgoing:
        """Return the request of a call with a body; None: it has none, or the usual one.

        Args:
            call: the operation.
            body: its values.
            media_type: in which they are written; a SOAP message is XML.
            root: the name of the root element, of XML.
            authorized: whether the credentials are sent.
        """

    def content(self, octets: bytes) -> Any:
        """Return what the body of a response says; None: nothing that can be read."""

    def forbids(self, call: str, body: Any) -> bool:
        """Return whether the device's description forbids a call."""


class JsonBinding:
    """JSON over HTTP."""

    syntax = "JSON"

    def __init__(self, api: RestInterface) -> None:
        self._api = api

    @property
    def has_credentials(self) -> bool:
        """Whether the connection has any."""
        return bool(self._api.client.connection.credentials.items)

    def made(
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
        if body is None:
            return Outgoing(method, path, fields, b"")
        if root:
            written = xml_bytes(body, root)
        else:
            written = json.dumps(body).encode() if media_type == JSON else urlencode(body).encode()
        return Outgoing(method, path, (("Content-Type", media_type),), written)

    def content(self, octets: bytes) -> Any:
        """Return the JSON of a body."""
        return read_json(octets).value

    def forbids(self, call: str, body: Any) -> bool:
        """Return whether the OpenAPI description forbids a call."""
        one = self.made(call, body)
        return validity(self._api.run.contract, one.method, one.target, one.media_type, one.body).verdict == INVALID


class SoapBinding:
    """SOAP by a WSDL; what the map does not say of a message is taken from [values], or is usual."""

    syntax = "XML"

    def __init__(self, api: RestInterface, messages: DescribedMessages) -> None:
        self._api, self._messages = api, messages
        self._operations = {label_of(port, one): (port, one) for port, one in each(messages.found.ports)}
        self._usual: dict[str, Node | None] = {}

    @property
    def has_credentials(self) -> bool:
        """Whether messages carry a token, or the connection has any."""
        return self._messages.token is not None or bool(self._api.client.connection.credentials.items)

    def made(
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
        """Return what the first element of the Body holds, without the names of namespaces."""
        try:
            parts = [one for one in elements(parse(octets)) if local(str(one.tag)) == "Body"]
        except NotXmlError:
            return None
        return next((value_of(one) for part in parts for one in elements(part)), None)

    def forbids(self, call: str, body: Any) -> bool:
        """Return whether the schema forbids a message."""
        try:
            node = self._node(call, body)[2]
        except NoElementError:
            return False  # no such message can be made
        return node is not None and bool(self._messages.found.types.invalid(parse(node.written())))


def binding_of(api: RestInterface) -> Binding:
    """Return how a device is called: by its WSDL if it has one.

    Raises:
        NotPossibleError, NoAnswerError: see DescribedMessages.of().
    """
    messages = DescribedMessages.of(api)
    return JsonBinding(api) if messages is None else SoapBinding(api, messages)
