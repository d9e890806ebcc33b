"""XML namespaces, and qualified names in Clark notation (``{namespace}name``)."""

from typing import Final

ENVELOPE: Final = "http://schemas.xmlsoap.org/soap/envelope/"
WSDL: Final = "http://schemas.xmlsoap.org/wsdl/"
WSDL_SOAP: Final = "http://schemas.xmlsoap.org/wsdl/soap/"
XSD: Final = "http://www.w3.org/2001/XMLSchema"
XSI: Final = "http://www.w3.org/2001/XMLSchema-instance"
WSAM: Final = "http://www.w3.org/2007/05/addressing/metadata"
# Forms of the action attribute that came before the metadata namespace, and that tools still write.
WSAW: Final = "http://www.w3.org/2006/05/addressing/wsdl"
ADDRESSING: Final = "http://www.w3.org/2005/08/addressing"
# SOAP 1.1, 4.2.2: the actor that stands for whoever receives the message first.
NEXT_ACTOR: Final = "http://schemas.xmlsoap.org/soap/actor/next"


def local(tag: str) -> str:
    """Return the local part of a name in Clark notation."""
    return tag.rpartition("}")[2]


def namespace(tag: str) -> str:
    """Return the namespace of a name in Clark notation; empty where it has none."""
    return tag[1:].rpartition("}")[0] if tag.startswith("{") else ""


def clark(space: str | None, name: str) -> str:
    """Return a name in Clark notation."""
    return f"{{{space}}}{name}" if space else name
