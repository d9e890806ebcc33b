"""The address of a service, read from its WSDL (WSDL 1.1 section 3.8, soap:address)."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from conformance.documents.wsdl import WsdlError, describe, name, unread
from conformance.transport.client import Connection
from conformance.transport.fetching import Fetcher
from conformance.transport.reach import Folder, Trust, UnreachableError, at_server, is_same, server_of
from loadtests.clients.endpoint import Endpoint, EndpointError
from loadtests.clients.failures import CallError
from loadtests.clients.payloads import CATALOGUE, NAMESPACE
from loadtests.clients.robot import Robot


def trust_of(robot: Robot) -> Trust:
    """Return the trust in the servers that the user named for a robot."""
    named = (robot.rest, robot.publishers, robot.subscribers, robot.publishers_wsdl, robot.subscribers_wsdl)
    return Trust.of(*named, hosts=robot.trust_hosts)


def loader(location: str, robot: Robot) -> Callable[[str], bytes]:
    """Return a function that reads a WSDL and its imports, from the robot's servers or the WSDL's folder.

    The function raises WsdlError if there is no such document, or it is elsewhere, and CallError if its server does not
    respond.
    """
    settings = Connection(
        timeout_s=robot.timeout_s, ca_file=Path(robot.ca_file) if robot.ca_file else None, token=robot.token
    )
    fetcher, folder = Fetcher(settings, trust_of(robot)), Folder(location)

    def load(place: str) -> bytes:
        try:
            return fetcher(place) if place.lower().startswith(("http://", "https://")) else folder.read(place)
        except UnreachableError as error:
            raise CallError("refused", str(error)) from None
        except OSError as error:
            raise WsdlError(f"WSDL {place!r}: {error.strerror or error}") from None
        except ValueError as error:
            raise WsdlError(f"WSDL {place!r}: {error}") from None

    return load


def fetch(location: str, robot: Robot) -> bytes:
    """Return the content of a WSDL, from a file or a URL.

    Raises:
        WsdlError: no such file, or the response is not a document.
        CallError: the URL does not respond.
    """
    return loader(location, robot)(location)


def address_in(content: bytes, location: str, element: str) -> str:
    """Return the address of the service whose port type offers an operation, on the server of a WSDL's URL.

    Raises:
        WsdlError: not XML, not a WSDL, another service's WSDL, or no address in it.
    """
    return _usable_address(_wsdl_address(content, location, element), location, Trust.of(location))


def _wsdl_address(content: bytes, location: str, element: str) -> str:
    """Return the address that a WSDL names, whatever its server.

    Raises:
        WsdlError: as address_in().
    """
    found = describe(content, location, unread)
    offered = sorted({name(operation) for operation in found.all("w:portType/w:operation")})
    if not found.all("w:import"):  # else another document may have them
        if element not in offered:
            raise WsdlError(f"WSDL {location!r} has no operation {element!r} (it has {', '.join(offered) or 'none'})")
        if found.target_namespace != NAMESPACE:
            raise WsdlError(f"WSDL {location!r}: its target namespace is {found.target_namespace!r}, not {NAMESPACE!r}")
    if not found.soap_address:
        raise WsdlError(f"WSDL {location!r} has no soap:address: give the address with --…-endpoint URL")
    try:
        Endpoint.parse(found.soap_address)
    except EndpointError as error:
        raise WsdlError(f"WSDL {location!r}: its soap:address cannot be used: {error}") from None
    return found.soap_address


def with_addresses(*robots: Robot) -> tuple[tuple[Robot, ...], list[str]]:
    """Return robots with the addresses that only their WSDLs contain, and remarks on those on other servers.

    Raises:
        WsdlError: a WSDL cannot be used, or only a file names the server that would get the token.
        CallError: a WSDL's URL does not respond.
    """
    remarks: list[str] = []
    return tuple(_with_addresses(robot, remarks) for robot in robots), remarks


def _with_addresses(robot: Robot, remarks: list[str]) -> Robot:
    found: dict[str, Any] = {}
    for call, operation in CATALOGUE.items():
        location = robot.wsdl(call)
        if location is None or robot.address("soap", call) is not None or operation.service in found:
            continue
        declared = _wsdl_address(fetch(location, robot), location, operation.element)
        trust = trust_of(robot)
        found[operation.service] = used = _usable_address(declared, location, trust)
        if not is_same(used, declared):
            remarks.append(
                f"the WSDL names the address {declared}, on another server: {used} was measured, on the WSDL's own "
                f"(--{operation.service}-endpoint and --trust-host change that)"
            )
        if robot.token and not trust.trusts(used):
            raise WsdlError(
                f"WSDL {location!r} names the address {declared}, and no description decides where a token goes: name "
                f"the address yourself, as by --{operation.service}-endpoint {declared}"
            )
    return replace(robot, **found)


def _usable_address(declared: str, location: str, trust: Trust) -> str:
    """Return the address to use: a WSDL from a server may name another server only if that is trusted."""
    if trust.trusts(declared):
        return trust.place(declared)
    return at_server(declared, declared, server_of(trust.place(location))) if "://" in location else declared
