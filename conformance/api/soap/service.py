"""A robot's SOAP service: its address, how messages are sent, and the robot's and the contract's descriptions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from conformance.api.soap.envelope import EMPTY
from conformance.api.soap.published_wsdl import PublishedWsdl, fetch, get, obtain
from conformance.contract.classes import Interface
from conformance.documents.wsdl import SoapOperation, Wsdl, WsdlError, describe, is_http, read_file, unread, unusable
from conformance.documents.xml import Node
from conformance.statement.statement import StatementError
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.reach import Folder, Trust, split

KnownMessages = Callable[["SoapService", SoapOperation], Iterable[Node]]

MEDIA_TYPE = "text/xml; charset=utf-8"
#: The statuses of a POST by which nothing takes messages at an address.
NO_SERVICE = frozenset({404, 405, 501})


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
        """The contract's description of the service.

        Raises:
            WsdlError: the contract's files cannot be used, or it has no such service.
        """
        if self.contract_wsdl_path is None:
            raise WsdlError(f"the contract has no {self.name} service")
        return read_file(self.contract_wsdl_path)

    @cached_property
    def _own_or_fault(self) -> tuple[Wsdl | None, str]:
        return self.published.interpret(self.endpoint, self.client.connection)

    @property
    def own(self) -> Wsdl | None:
        """The robot's own description of the service; None if it could not be read (see own_problem)."""
        return self._own_or_fault[0]

    @property
    def own_problem(self) -> str:
        """Why the robot's own description is missing; empty if there is one."""
        return self._own_or_fault[1]

    @cached_property
    def description(self) -> Wsdl:
        """Return the description that a client would use: the robot's own if it is usable, else the contract's."""
        return self.own if self.own is not None and not next(unusable(self.own), "") else self.contract

    @cached_property
    def mistaken(self) -> str:
        """Why the given WSDL is not that of this service, or an empty text: a robot may serve a WSDL with faults.

        Raises:
            NoAnswerError: no HTTP response came.
        """
        given, names, why = self.published, set[str](), ""
        with suppress(WsdlError):
            found = describe(given.document or b"", given.source or "", unread)
            names = {operation.name for operation in found.operations}
        if names and self.contract_wsdl_path and not names & {one.name for one in self.contract.operations}:
            why = f"{given.source} describes another service, with the operations {', '.join(sorted(names)[:3])}"
        elif not names and given.attempt is not None:
            # Where only GET is permitted, it has to do.
            may_post = not self.client.refusal("POST", self.path)
            sent = self.post(EMPTY) if may_post else self.client.send("GET", self.path)
            if sent.response.status in (NO_SERVICE if may_post else {404}):
                got = f"{sent.request.method} {self.endpoint} returned {sent.came}"
                why = f"GET {given.source} returned {given.attempt.came} and no WSDL, and {got}"
        return f"{why}; name the WSDL of the {self.name} service with --{self.name}-wsdl" if why else ""

    def fetch(self, location: str) -> bytes:
        """Read a document that the robot's WSDL refers to, or the contract's where the robot has none.

        Raises:
            OSError, ValueError: it cannot be had.
        """
        own = self.published.source if self.published.document is not None else None
        folder = Folder(own or str(self.contract_wsdl_path))
        return fetch(location, self.published.url or self.endpoint, self.client.connection, folder)


# How long the address in a WSDL may take to answer, s. After that, the address of the WSDL itself is used.
_PROBE_S = 3.0


def open_service(
    name: Interface,
    wsdl: str | None,
    endpoint: str | None,
    connection: Connection,
    contract_wsdl_path: Path | None,
    known_messages: KnownMessages = lambda _service, _operation: (),
) -> SoapService:
    """Find a service's address. Whatever the robot responds, the service that is returned can be called.

    An endpoint that is given wins. Else it is what the WSDL's soap:address says, if that is on a server that the user
    named and answers; else the WSDL's URL without its query.

    Args:
        name: ``publishers`` or ``subscribers``.
        wsdl: URL or file of the robot's WSDL.
        endpoint: URL of the service.
        connection: deadline, credentials, ceiling and listeners.
        contract_wsdl_path: the contract's WSDL of this service.
        known_messages: messages that a robot of this contract is likely to take.

    Raises:
        StatementError: what was given names no place: no HTTP URL, a file that cannot be read, or one that names no
            usable address while no endpoint is given, or alone decides where credentials go.
    """
    for option, url in (("endpoint", endpoint), ("WSDL", wsdl if wsdl and "://" in wsdl else None)):
        if url is not None and not is_http(url):
            raise StatementError(f"{name} {option} {url!r} is no http or https URL")
    published = obtain(name, wsdl, connection)
    where = endpoint or _own_address(published, connection)
    if where is None:
        raise StatementError(
            f"{name}: {wsdl} has no soap:address with an http URL; say where the service is with --{name}-endpoint"
        )
    if not endpoint and published.url is None and connection.credentials and not connection.may_authorize(where):
        raise StatementError(
            f"{name}: {wsdl} names the address {where}, and no description decides where credentials go: name the "
            f"address yourself, as by --{name}-endpoint {where}"
        )
    base, path = split(where)
    return SoapService(name, HttpClient(base, connection), path, published, contract_wsdl_path, known_messages)


def _own_address(published: PublishedWsdl, connection: Connection) -> str | None:
    """Return the address in a service's WSDL; None if a file names none."""
    try:
        address = describe(published.document or b"", published.source or "", unread).soap_address
    except WsdlError:
        address = ""
    if published.url is None:
        return address if is_http(address) else None
    trust = connection.trust or Trust.of(published.url)
    if address and trust.trusts(address):
        try:
            get(trust.place(address), connection, timeout_s=min(_PROBE_S, connection.timeout_s))
        except NoAnswerError:
            pass
        else:
            return trust.place(address)
    return published.url.split("?", 1)[0]
