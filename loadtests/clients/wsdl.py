"""The address of a service, read from its WSDL (WSDL 1.1 section 3.8, soap:address)."""

from dataclasses import replace
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit, urlunsplit

import requests

from loadtests.clients.endpoint import Endpoint, EndpointError
from loadtests.clients.library import new_session, request_error
from loadtests.clients.payloads import CATALOGUE, NAMESPACE
from loadtests.clients.robot import Robot
from loadtests.clients.xml_reader import XmlError, parse_xml

_WSDL = "http://schemas.xmlsoap.org/wsdl/"
_SOAP = "http://schemas.xmlsoap.org/wsdl/soap/"
_MOST = 4 * 1024 * 1024


class WsdlError(ValueError):
    """A WSDL that cannot be used; the message says what is wrong with it."""


def fetch(location: str, robot: Robot) -> bytes:
    """Return the content of a WSDL, from a file or a URL.

    Raises:
        WsdlError: no such file, or the response is not a document.
        CallError: the URL does not respond.
    """
    if not location.startswith(("http://", "https://")):
        try:
            return Path(location).read_bytes()
        except OSError as error:
            raise WsdlError(f"WSDL {location!r}: {error.strerror or error}") from None
    try:
        with new_session(robot) as session:
            answer = session.get(location, timeout=robot.timeout_s)
    except requests.RequestException as error:
        raise request_error(error, location, robot.timeout_s) from None
    if answer.status_code != requests.codes.ok:
        raise WsdlError(f"WSDL {location!r}: status {answer.status_code} instead of a document")
    return answer.content


def address_in(content: bytes, location: str, element: str) -> str:
    """Return the address of the service whose port type offers an operation.

    Raises:
        WsdlError: not XML, not a WSDL, another service's WSDL, or no address in it.
    """
    if len(content) > _MOST:
        raise WsdlError(f"WSDL {location!r} is longer than {_MOST} bytes")
    try:
        root = parse_xml(content)
    except XmlError as error:
        raise WsdlError(f"WSDL {location!r} {error}") from None
    if root.tag != f"{{{_WSDL}}}definitions":
        raise WsdlError(f"{location!r} is not a WSDL 1.1: its root element is {root.tag!r}")
    offered = {found.get("name") for found in root.iter(f"{{{_WSDL}}}operation")}
    imports = root.findall(f"{{{_WSDL}}}import")
    if element not in offered and not imports:
        raise WsdlError(
            f"WSDL {location!r} has no operation {element!r} (it has {', '.join(sorted(map(str, offered))) or 'none'})"
        )
    if root.get("targetNamespace") != NAMESPACE and not imports:
        raise WsdlError(
            f"WSDL {location!r}: its target namespace is {root.get('targetNamespace')!r}, not {NAMESPACE!r}"
        )
    for address in root.iter(f"{{{_SOAP}}}address"):
        url = address.get("location") or ""
        try:
            Endpoint.parse(url)
        except EndpointError as error:
            raise WsdlError(f"WSDL {location!r}: its soap:address cannot be used: {error}") from None
        return _reachable(url, location)
    raise WsdlError(f"WSDL {location!r} has no soap:address: give the address with --…-endpoint URL")


def with_addresses(robot: Robot) -> Robot:
    """Return the robot with the addresses that only its WSDLs contain.

    Raises:
        WsdlError: a WSDL cannot be used.
        CallError: a WSDL's URL does not respond.
    """
    found: dict[str, Any] = {}
    for name, operation in CATALOGUE.items():
        location = robot.wsdl(name)
        if location is None or robot.address("soap", name) is not None or operation.service in found:
            continue
        found[operation.service] = address_in(fetch(location, robot), location, operation.element)
    return replace(robot, **found)


def _reachable(url: str, location: str) -> str:
    """Replace the loopback host in a WSDL that was fetched from another machine by that machine."""
    there, here = urlsplit(url), urlsplit(location)
    if here.scheme in {"http", "https"} and _is_own(there.hostname) and not _is_own(here.hostname):
        host = f"[{here.hostname}]" if ":" in (here.hostname or "") else here.hostname
        return urlunsplit(there._replace(netloc=f"{host}:{there.port}" if there.port else str(host)))
    return url


def _is_own(host: str | None) -> bool:
    """Return whether a host name means the machine that uses it: a loopback address, or 0.0.0.0 or `::`."""
    if host is None or host == "localhost":
        return host is not None
    try:
        address = ip_address(host)
    except ValueError:
        return False
    return address.is_loopback or address.is_unspecified
