"""Addresses of services; WS-Addressing: whether a WSDL demands it, an operation's action, a request's header blocks."""

from __future__ import annotations

import uuid
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

from conformance.documents.xml_names import ADDRESSING, WSAM, WSAW, WSDL, clark
from conformance.documents.xml_node import Node

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lxml import etree

_ANONYMOUS: Final = f"{ADDRESSING}/anonymous"
_TRUE: Final = frozenset({"true", "1"})
_POLICIES: Final = ("http://www.w3.org/ns/ws-policy", "http://schemas.xmlsoap.org/ws/2004/09/policy")


def is_http(address: str) -> bool:
    """Return whether an address is a URL over HTTP that can be called."""
    try:
        parts = urlsplit(address)
        return bool(parts.hostname) and parts.scheme in {"http", "https"} and parts.port != 0
    except ValueError:
        return False


def wants_addressing(places: Sequence[etree._Element], policies: Sequence[etree._Element]) -> bool:
    """Return whether messages must have WS-Addressing's header blocks (its Metadata, 3.1).

    Args:
        places: the binding, and the port.
        policies: all policies of the WSDL, which those may refer to.
    """
    wanted = {one.get("URI", "").removeprefix("#") for place in places for one in place.iter("{*}PolicyReference")}
    named = [one for one in policies if set(one.attrib.values()) & wanted]
    marks = (clark(WSAW, "UsingAddressing"), clark(WSAM, "Addressing"))
    return any(_required(mark) for place in (*places, *named) for mark in place.iter(*marks))


def _required(mark: etree._Element) -> bool:
    """Return whether an extension or a policy assertion on WS-Addressing demands it of each message.

    An extension does where `wsdl:required` says so; an assertion does unless it is optional.
    """
    if mark.tag == clark(WSAW, "UsingAddressing"):
        return mark.get(clark(WSDL, "required")) in _TRUE
    return not any(mark.get(clark(space, "Optional")) in _TRUE for space in _POLICIES)


def addressing_action(operation: etree._Element, port_type: etree._Element, soap_action: str) -> str:
    """Return the action of a request: as its input says, that of SOAP, or the default (its Metadata, 4.4)."""
    given = operation.find(clark(WSDL, "input"))
    if given is None:
        return ""
    said = next(
        (given.get(clark(space, "Action")) for space in (WSAM, WSAW) if given.get(clark(space, "Action"))), None
    )
    if said or soap_action:
        return said or soap_action
    bound = port_type.getparent()
    space = (bound.get("targetNamespace") or "") if bound is not None else ""
    mark = ":" if space.startswith("urn:") else "/"
    suffix = "" if operation.find(clark(WSDL, "output")) is None else "Request"
    name = given.get("name") or f"{operation.get('name')}{suffix}"
    return mark.join((space.rstrip(mark), port_type.get("name") or "", name))


def addressing_blocks(action: str, address: str) -> tuple[Node, ...]:
    """Return the header blocks of a request (WS-Addressing Core, 3.1), with a message id of its own."""
    reply = Node(clark(ADDRESSING, "ReplyTo"), children=(Node(clark(ADDRESSING, "Address"), _ANONYMOUS),))
    return (
        Node(clark(ADDRESSING, "Action"), action),
        Node(clark(ADDRESSING, "To"), address),
        Node(clark(ADDRESSING, "MessageID"), f"urn:uuid:{uuid.uuid4()}"),
        reply,
    )
