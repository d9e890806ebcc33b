"""A robot's SOAP service: where it is, how its messages are sent, and what it says of itself."""

from __future__ import annotations

import ipaddress
from contextlib import closing
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from conformance.contract.statement import StatementError
from conformance.documents.wsdl import Description, DescriptionError, describe, faults, read_file
from conformance.documents.xml import NotXmlError, parse
from conformance.documents.xml_names import WSDL_SOAP, clark
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from conformance.documents.xml_node import Node
    from conformance.transport.exchange import Attempt, Exchange

MEDIA_TYPE = "text/xml; charset=utf-8"
# How long the address in a WSDL is given to answer before the WSDL's own is taken instead, s.
_PROBE_S = 3.0


@dataclass
class SoapService:
    """One service.

    Attributes:
        name: ``publishers`` or ``subscribers``.
        client: sends to the scheme and authority of the endpoint.
        path: the endpoint's path (and query, where it has one).
        wsdl_source: URL or file of the robot's WSDL, or None where none was named.
        wsdl: the WSDL, or None where it is not to be had.
        wsdl_problem: why it is not to be had, or empty.
        wsdl_exchange: the request for it, where it was fetched.
        contract_wsdl_path: the contract's WSDL of this service, or None.
        address: what the WSDL says where the service is, or None.
        examples: messages that the robot takes, by operation (see baseline).
    """

    name: str
    client: HttpClient
    path: str
    wsdl_source: str | None = None
    wsdl: bytes | None = None
    wsdl_problem: str = ""
    wsdl_exchange: Attempt | None = None
    contract_wsdl_path: Path | None = None
    address: str | None = None
    examples: dict[str, Node | None] = field(default_factory=dict, repr=False)
    _own_read: tuple[Description | None, str] | None = field(default=None, init=False, repr=False)

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
        """The same service through a client of its own.

        A client no longer asks an endpoint that let deadlines pass. Messages on which a robot may wait for more are
        sent apart, so that they do not silence the rest.
        """
        twin = copy(self)
        twin.client = HttpClient(self.client.base_url, self.client.connection)
        return twin

    @cached_property
    def contract(self) -> Description:
        """What the contract says of the service.

        Raises:
            DescriptionError: the contract's files cannot be used, or it has no such service.
        """
        if self.contract_wsdl_path is None:
            raise DescriptionError(f"the contract has no {self.name} service")
        return read_file(self.contract_wsdl_path)

    @cached_property
    def own(self) -> Description | None:
        """What the robot says of the service; None where it says nothing that could be read (see own_problem)."""
        return self._read_own()[0]

    @property
    def own_problem(self) -> str:
        """Why there is no description of the robot's own; empty where there is one."""
        return self._read_own()[1]

    @cached_property
    def described(self) -> Description:
        """What a client would go by: the robot's own description where it can be used, else the contract's."""
        return self.own if self.own is not None and not next(faults(self.own), "") else self.contract

    def _read_own(self) -> tuple[Description | None, str]:
        if self._own_read is None:
            self._own_read = self._interpreted()
        return self._own_read

    def _interpreted(self) -> tuple[Description | None, str]:
        if self.wsdl is None or self.wsdl_source is None:
            return None, self.wsdl_problem
        try:
            return describe(self.wsdl, self.wsdl_source, self.fetch), ""
        except DescriptionError as error:
            return None, str(error)

    def fetch(self, location: str) -> bytes:
        """A document that the WSDL refers to: beside it when it is a file, else from the robot and no other host.

        Raises:
            OSError: it cannot be had.
        """
        if "://" not in location:
            return Path(location).read_bytes()
        source = self.wsdl_source if self.wsdl_source and "://" in self.wsdl_source else self.endpoint
        # A robot behind a proxy or another name writes locations with its own: the same path is asked for here.
        base, path = _split(source)[0], _split(location)[1]
        try:
            with closing(HttpClient(base, self.client.connection)) as client:
                exchange = client.send("GET", path)
        except NoAnswerError as none:
            raise OSError(str(none)) from none
        if exchange.response.status != 200:  # noqa: PLR2004 - RFC 9110 15.3.1
            raise OSError(f"GET {path} is answered with {exchange.came}")
        return exchange.response.body


def open_service(
    name: str, wsdl: str | None, endpoint: str | None, connection: Connection, contract_wsdl_path: Path | None
) -> SoapService:
    """Find out where a service is. Whatever the robot answers, there is a service to send to afterwards.

    An endpoint that is given wins. Else it is what the WSDL's soap:address says, if that answers; else the WSDL's URL
    without its query.

    Args:
        name: ``publishers`` or ``subscribers``.
        wsdl: URL or file of the robot's WSDL.
        endpoint: URL of the service.
        connection: deadline, credentials, ceiling and listeners.
        contract_wsdl_path: the contract's WSDL of this service.

    Raises:
        StatementError: what was given names no place: no HTTP URL, a file that cannot be read, or one that names no
            usable address while no endpoint is given.
    """
    for option, url in (("endpoint", endpoint), ("WSDL", wsdl if wsdl and "://" in wsdl else None)):
        if url is not None and not _is_http(url):
            raise StatementError(f"{name} {option} {url!r} is no http or https URL")
    document, problem, exchange = (None, "the statement names no WSDL", None)
    if wsdl is not None:
        document, problem, exchange = _obtain(name, wsdl, connection)
    address = _address(document) if document else None
    where = endpoint
    if where is None and wsdl is not None and "://" in wsdl:
        where = address if address and _answers(address, wsdl, connection) else wsdl.split("?", 1)[0]
    elif where is None and address and _is_http(address):
        where = address
    if where is None:
        raise StatementError(
            f"{name}: {wsdl} has no soap:address with an http URL; say where the service is with --{name}-endpoint"
        )
    base, path = _split(where)
    return SoapService(
        name, HttpClient(base, connection), path, wsdl, document, problem, exchange, contract_wsdl_path, address
    )


def _obtain(name: str, wsdl: str, connection: Connection) -> tuple[bytes | None, str, Attempt | None]:
    """The WSDL, why there is none, and the request for it."""
    if "://" not in wsdl:
        try:
            return Path(wsdl).read_bytes(), "", None
        except OSError as error:
            raise StatementError(f"{name} WSDL {wsdl!r} cannot be read: {error.strerror or error}") from error
    base, path = _split(wsdl)
    try:
        with closing(HttpClient(base, connection)) as client:
            exchange = client.send("GET", path)
    except NoAnswerError as none:
        return None, str(none), none.unanswered
    answer = exchange.response
    if answer.status != 200:  # noqa: PLR2004 - RFC 9110 15.3.1
        return None, f"GET {wsdl} is answered with {exchange.came}", exchange
    return answer.body, "", exchange


def _address(document: bytes) -> str | None:
    """The first soap:address in a WSDL, however broken the WSDL is otherwise."""
    try:
        root = parse(document, doctype=True)
    except NotXmlError:
        return None
    for element in root.iter(clark(WSDL_SOAP, "address")):
        location = (element.get("location") or "").strip()
        if location:
            return location
    return None


def _answers(address: str, wsdl: str, connection: Connection) -> bool:
    """Whether the address that a WSDL names can be used from here."""
    if not _is_http(address):
        return False
    named, asked = urlsplit(address).hostname or "", urlsplit(wsdl).hostname or ""
    if named != asked and (
        _is_unspecified(named)
        or (_is_loopback(named) and not _is_loopback(asked))
        # The token is for the robot that the statement names, not for whomever the robot names.
        or (connection.token is not None and not (_is_loopback(named) and _is_loopback(asked)))
    ):
        return False
    base, path = _split(address)
    try:
        with closing(HttpClient(base, connection)) as client:
            client.send("GET", path, timeout_s=min(_PROBE_S, connection.timeout_s))
    except NoAnswerError:
        return False
    return True


def _is_http(url: str) -> bool:
    try:
        parts = urlsplit(url)
        return parts.scheme in {"http", "https"} and bool(parts.hostname) and parts.port != 0
    except ValueError:
        return False


def _is_unspecified(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")


def _split(url: str) -> tuple[str, str]:
    """Scheme with authority, and path with query."""
    parts = urlsplit(url)
    path = parts.path or "/"
    return f"{parts.scheme}://{parts.netloc.rsplit('@', 1)[-1]}", f"{path}?{parts.query}" if parts.query else path
