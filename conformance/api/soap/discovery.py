"""Finding out where a robot's SOAP service is."""

from pathlib import Path

from conformance.api.soap.published_wsdl import PublishedWsdl, get, obtain
from conformance.api.soap.service import KnownMessages, SoapService
from conformance.contract.interfaces import Interface
from conformance.documents.addressing import is_http
from conformance.documents.wsdl import WsdlError, describe, unread
from conformance.statement.statement import StatementError
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError
from conformance.transport.reach import Trust, split

# How long the address in a WSDL is given to answer before the WSDL's own is taken instead, s.
_PROBE_S = 3.0


def open_service(
    name: Interface,
    wsdl: str | None,
    endpoint: str | None,
    connection: Connection,
    contract_wsdl_path: Path | None,
    known_messages: KnownMessages = lambda _service, _operation: (),
) -> SoapService:
    """Find out where a service is. Whatever the robot answers, there is a service to send to afterwards.

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
    where = endpoint or _located(published, connection)
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


def _located(published: PublishedWsdl, connection: Connection) -> str | None:
    """Return the address of a service by its WSDL; None where a file does not name one."""
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
