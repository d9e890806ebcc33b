"""URLs of services: which can be used at all, and what a WSDL says of them."""

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
