"""URLs of services: which can be used at all, and which of a robot's own words are followed."""

import ipaddress
from urllib.parse import urlsplit

from conformance.documents.xml import NotXmlError, parse
from conformance.documents.xml_names import WSDL_SOAP, clark


def is_http(url: str) -> bool:
    """Return whether a URL is an http or https URL with a host and a port."""
    try:
        parts = urlsplit(url)
        return parts.scheme in {"http", "https"} and bool(parts.hostname) and parts.port != 0
    except ValueError:
        return False


def split(url: str) -> tuple[str, str]:
    """Return scheme with authority, and path with query."""
    parts = urlsplit(url)
    path = parts.path or "/"
    return f"{parts.scheme}://{parts.netloc.rsplit('@', 1)[-1]}", f"{path}?{parts.query}" if parts.query else path


def soap_address(wsdl: bytes) -> str | None:
    """Return the first soap:address in a WSDL, however broken the WSDL is otherwise; None without one."""
    try:
        root = parse(wsdl, doctype=True)
    except NotXmlError:
        return None
    for element in root.iter(clark(WSDL_SOAP, "address")):
        location = (element.get("location") or "").strip()
        if location:
            return location
    return None


def may_be_followed(address: str, wsdl: str, *, with_token: bool) -> bool:
    """Return whether to try the address that a WSDL names.

    Args:
        address: what the soap:address says.
        wsdl: URL that the WSDL came from.
        with_token: whether a token would be sent along: it is for the robot that the statement names, not for whomever
            the robot names.
    """
    if not is_http(address):
        return False
    named, asked = urlsplit(address).hostname or "", urlsplit(wsdl).hostname or ""
    if named == asked:
        return True
    both_here = _is_loopback(named) and _is_loopback(asked)
    # 0.0.0.0 is no address to send to, and a loopback address of another machine is not there.
    return not _is_unspecified(named) and (both_here or not (_is_loopback(named) or with_token))


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
