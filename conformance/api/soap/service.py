"""A robot's SOAP service: how messages are sent to it, and what it and the contract say of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from conformance.api.soap.published_wsdl import PublishedWsdl, fetch
from conformance.contract.interfaces import Interface
from conformance.documents.wsdl import SoapOperation, Wsdl, WsdlError, read_file, unusable
from conformance.documents.xml_node import Node
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.transport.reach import Folder

KnownMessages = Callable[["SoapService", SoapOperation], Iterable[Node]]

MEDIA_TYPE = "text/xml; charset=utf-8"


@dataclass
class SoapService:
    """One service.

    Attributes:
        name: ``publishers`` or ``subscribers``.
        client: sends to the scheme and authority of the endpoint.
        path: the endpoint's path (and query, where it has one).
        published: the WSDL that the robot publishes.
        contract_wsdl_path: the contract's WSDL of this service, or None.
        known_messages: those of this contract.
        examples: messages that the robot takes, by operation (see valid_messages).
    """

    name: Interface
    client: HttpClient
    path: str
    published: PublishedWsdl = field(default_factory=PublishedWsdl)
    contract_wsdl_path: Path | None = None
    known_messages: KnownMessages = lambda _service, _operation: ()
    examples: dict[str, Node | None] = field(default_factory=dict, repr=False)

    @property
    def endpoint(self) -> str:
        """URL to which messages go."""
        return self.client.base_url + self.path

    def post(
        self,
        body: bytes,
        *,
        headers: Iterable[tuple[str, str]] = (),
        fresh: bool = False,
        soap_action: str | None = '""',
        content_type: str | None = MEDIA_TYPE,
        timeout_s: float | None = None,
    ) -> Exchange:
        """Send a message.

        Args:
            body: octets.
            headers: further fields.
            fresh: over a connection of its own.
            soap_action: value of SOAPAction; None leaves it out.
            content_type: value of Content-Type; None leaves it out.
            timeout_s: another deadline than the run's.

        Raises:
            NoAnswerError: no HTTP response came.
        """
        fields = list(headers)
        if content_type is not None:
            fields.insert(0, ("Content-Type", content_type))
        if soap_action is not None:
            fields.append(("SOAPAction", soap_action))
        return self.client.send("POST", self.path, headers=fields, body=body, fresh=fresh, timeout_s=timeout_s)

    def apart(self) -> SoapService:
        """Return the same service with a client of its own.

        A client no longer asks an endpoint that let deadlines pass. Messages on which a robot may wait for more are
        sent apart, so that they do not silence the rest.
        """
        twin = copy(self)
        twin.client = HttpClient(self.client.base_url, self.client.connection)
        return twin

    @cached_property
    def contract(self) -> Wsdl:
        """What the contract says of the service.

        Raises:
            WsdlError: the contract's files cannot be used, or it has no such service.
        """
        if self.contract_wsdl_path is None:
            raise WsdlError(f"the contract has no {self.name} service")
        return read_file(self.contract_wsdl_path)

    @cached_property
    def _interpreted(self) -> tuple[Wsdl | None, str]:
        return self.published.interpreted(self.endpoint, self.client.connection)

    @property
    def own(self) -> Wsdl | None:
        """What the robot says of the service; None where it says nothing that could be read (see own_problem)."""
        return self._interpreted[0]

    @property
    def own_problem(self) -> str:
        """Why there is no description of the robot's own; empty where there is one."""
        return self._interpreted[1]

    @cached_property
    def described(self) -> Wsdl:
        """What a client would go by: the robot's own description where it can be used, else the contract's."""
        return self.own if self.own is not None and not next(unusable(self.own), "") else self.contract

    def fetch(self, location: str) -> bytes:
        """Read a document that the robot's WSDL refers to, or the contract's where the robot has none.

        Raises:
            OSError, ValueError: it cannot be had.
        """
        own = self.published.source if self.published.document is not None else None
        folder = Folder(own or str(self.contract_wsdl_path))
        return fetch(location, self.published.url or self.endpoint, self.client.connection, folder)
