"""Messages to the operations of a WSDL, as HTTP requests."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from lxml import etree

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.samples import sample
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import ordinary, simple_leaves, unknown_in, with_text
from conformance.api.soap.roles import TEXTS
from conformance.commandline.device_options import advice
from conformance.documents.wsdl import SoapOperation, SoapPort, Wsdl, addressing_blocks
from conformance.documents.wsdl_pack import services_of
from conformance.documents.xml import Node, clark, parse
from conformance.documents.xsd_shapes import INTEGERS, Element
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.client import Headers
from conformance.transport.credentials import UsernameToken
from conformance.transport.reach import split

_NONE: Final[Mapping[str, Sequence[str]]] = MappingProxyType({})
# Names of numbers that refer to something.
_ID: Final = re.compile(r"(?:id|token|handle|index|ref|key|number|name)$", re.IGNORECASE)


@dataclass(frozen=True)
class DescribedMessages:
    """Makes messages.

    Attributes:
        found: what the WSDL describes.
        values: texts for elements, by local name.
        token: the user whose token each message carries, or None.
    """

    found: Wsdl
    values: dict[str, tuple[object, ...]] = field(default_factory=dict)
    token: UsernameToken | None = None

    @classmethod
    def of(cls, api: RestInterface) -> DescribedMessages | None:
        """Return it for a device; None if the device has no WSDL.

        Raises:
            NotPossibleError: the token's file cannot be used.
            NoAnswerError: the device does not tell its time.
        """
        found = services_of(api.run.contract)
        if found is None:
            return None
        try:
            token = UsernameToken.of(api.run.statement.endpoints.username_token_file)
        except (OSError, ValueError) as error:
            raise NotPossibleError(str(error)) from error
        if token is not None:
            token.set_clock(api.client.send("GET", "/").response.header("date"))
        return cls(found, api.run.statement.values, token)

    def message(
        self,
        port: SoapPort,
        operation: SoapOperation,
        node: Node | None,
        *more: Node,
        space: str = "",
        authorized: bool = True,
    ) -> bytes:
        """Return a message as bytes; see `whole`."""
        made = self.whole(port, operation, node, *more, space=space, authorized=authorized)
        return b'<?xml version="1.0" encoding="utf-8"?>\n' + made.serialize()

    def whole(
        self,
        port: SoapPort,
        operation: SoapOperation,
        node: Node | None,
        *more: Node,
        space: str = "",
        authorized: bool = True,
    ) -> Node:
        """Return a message, with further header blocks, or in another namespace than that of the port's Envelope.

        It has the header blocks that the WSDL demands.

        Raises:
            NotPossibleError: one of them cannot be made.
        """
        token = self.token if authorized else None
        own = (self._make(tag, operation)[1] for tag in operation.headers)
        addressed = addressing_blocks(operation.addressed, port.url) if operation.addressed else ()
        blocks = (*([block_of(token, space or port.envelope)] if token else ()), *own, *addressed, *more)
        return envelope((node,) if node else (), blocks or None, space or port.envelope)

    def usual(
        self,
        operation: SoapOperation,
        turn: int = 0,
        given: Mapping[str, Sequence[str]] = _NONE,
        current: Mapping[str, str] = MappingProxyType({}),
        form: int | None = None,
    ) -> tuple[Element | None, Node | None]:
        """Return the declaration of an operation's request, and a valid message; None if its Body is empty.

        Args:
            operation: the operation.
            turn: which of the given values to use, in rotation.
            given: further values, which the device gave, by what they are called.
            current: values to keep, by name in lower case, as far as they are valid together.
            form: with all optional parts, in this form (see `ordinary`); None means without them, if that is valid.

        Raises:
            NotPossibleError: none can be made.
        """
        if not operation.request:
            return None, None
        declared, made = self._make(operation.request, operation, turn, given, form)
        kept = made
        for path, _ in simple_leaves(declared, made) if current else ():
            name = made.at(path).name
            if name not in self.values and (text := current.get(name.lower())) is not None:
                kept = with_text(kept, path, text)
        return declared, made if self.found.types.invalid(parse(kept.serialize())) else kept

    def invented_names(self, declared: Element, node: Node, *, named: bool = False) -> list[str]:
        """Return the names of values that only the device can know: texts, and numbers that are ids.

        ``named``: with those of [values], which the device may know no more.
        """
        return [
            node.at(path).name
            for path, simple in simple_leaves(declared, node)
            if not simple.enumeration
            and (simple.builtin in TEXTS or (simple.builtin in INTEGERS and _ID.search(node.at(path).name)))
            and (named or node.at(path).name not in self.values)
        ]

    def _make(
        self,
        tag: str,
        operation: SoapOperation,
        turn: int = 0,
        given: Mapping[str, Sequence[str]] = _NONE,
        form: int | None = None,
    ) -> tuple[Element, Node]:
        """Return the declaration of an element of an operation's messages, and a valid element.

        Raises:
            NotPossibleError: none can be made.
        """
        declared = self.found.types.shape(tag)
        if declared is None:
            raise NotPossibleError(f"no schema declares {tag} of {operation.name}")
        fault = ""
        for optional in (False, True) if form is None else (True,):
            node = ordinary(declared, optional=optional, form=form or 0)
            unsure = self.invented_names(declared, node, named=True)
            for path, simple in simple_leaves(declared, node):
                name = node.at(path).name
                values = (given.get(name.lower()) if name in unsure else None) or self.values.get(name)
                if not values and name in unsure and simple.patterns:
                    values = [str(sample({"type": "string", "pattern": f"^(?:{simple.patterns[0]})$"}))]
                if values:
                    node = with_text(node, path, str(values[turn % len(values)]))
            if lacking := unknown_in(declared, node):
                how = advice(": give the folder of its schema by --schemas")
                fault = f"no document declares what {lacking} holds{how}"
                continue
            fault = self.found.types.invalid(parse(node.serialize()))
            if not fault:
                return declared, node
        raise NotPossibleError(f"no valid message can be made for {operation.name} without values in [values]: {fault}")


def values_in(element: etree._Element) -> dict[str, list[str]]:
    """Return the texts in a response by names that a request may use: of element or attribute, and with the parent's.

    A `Preset` with the attribute `token` gives a `PresetToken`.
    """
    found: dict[str, list[str]] = {}
    for one in element.iter(etree.Element):
        own, parent = etree.QName(one).localname, one.getparent()
        within = etree.QName(parent).localname if parent is not None else ""
        named = [(within, own, (one.text or "").strip())] if not len(one) else []
        named += [(own, etree.QName(str(key)).localname, str(text)) for key, text in one.attrib.items()]
        for outer, name, text in named:
            for key in (name, f"{outer}{name}", f"{outer.removesuffix('s')}{name}"):
                values = found.setdefault(key.lower(), [])
                if text and text not in values:
                    values.append(text)
    return {key: values for key, values in found.items() if values}


def target_of(port: SoapPort) -> str:
    """Return the request target of a port: a device behind a front does not know its own scheme and host."""
    return split(port.url)[1]


def fields_of(port: SoapPort, operation: SoapOperation) -> Headers:
    """Return the header fields of a message (SOAP 1.1, 6.1.1; SOAP 1.2 Part 2, 7.5.1 and Appendix B)."""
    if port.is_12:
        action = f'; action="{operation.action}"' if operation.action else ""
        return (("Content-Type", f"application/soap+xml; charset=utf-8{action}"),)
    return (("Content-Type", "text/xml; charset=utf-8"), ("SOAPAction", f'"{operation.action}"'))


_WSS: Final = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-"
_SECURITY: Final = f"{_WSS}wssecurity-secext-1.0.xsd"
_UTILITY: Final = f"{_WSS}wssecurity-utility-1.0.xsd"
_DIGEST: Final = f"{_WSS}username-token-profile-1.0#PasswordDigest"
_BASE64: Final = f"{_WSS}soap-message-security-1.0#Base64Binary"


def block_of(user: UsernameToken, envelope: str) -> Node:
    """Return a header block with a fresh nonce, for an Envelope of that namespace."""
    digest, nonce, created = user.fresh()
    token = Node(
        clark(_SECURITY, "UsernameToken"),
        children=(
            Node(clark(_SECURITY, "Username"), user.user),
            Node(clark(_SECURITY, "Password"), digest, (), (("Type", _DIGEST),)),
            Node(clark(_SECURITY, "Nonce"), nonce, (), (("EncodingType", _BASE64),)),
            Node(clark(_UTILITY, "Created"), created),
        ),
    )
    return Node(clark(_SECURITY, "Security"), "", (token,), ((clark(envelope, "mustUnderstand"), "1"),))
