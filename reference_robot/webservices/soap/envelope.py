"""Parsing of a SOAP message, by the rules of SOAP 1.1 and the Basic Profile; and faults (SOAP 1.1, 4.4)."""

from enum import StrEnum
from typing import Any, Final

from lxml import etree

from reference_robot.webservices.representation.problems import clip
from reference_robot.webservices.representation.writing import element_of, text_of

SOAP: Final = "http://schemas.xmlsoap.org/soap/envelope/"


class FaultCode(StrEnum):
    """The standard fault codes of SOAP 1.1, in the order of the checks (WS-I BP R1004, R2725)."""

    VERSION_MISMATCH = "VersionMismatch"
    MUST_UNDERSTAND = "MustUnderstand"
    CLIENT = "Client"
    SERVER = "Server"


class Fault(Exception):  # noqa: N818 - SOAP's own name for it
    """An error that is answered with a SOAP fault; its text names element and value, ``detail`` holds more, by name."""

    def __init__(self, code: FaultCode, text: str, detail: dict[str, Any] | None = None) -> None:
        super().__init__(text)
        self.code = code
        self.text = text
        self.detail = detail

    def envelope(self) -> bytes:
        """Return the serialized envelope with the fault: its children unqualified (R1001), its code qualified."""
        root = etree.Element(f"{{{SOAP}}}Envelope", nsmap={"soap": SOAP})
        fault = etree.SubElement(etree.SubElement(root, f"{{{SOAP}}}Body"), f"{{{SOAP}}}Fault")
        etree.SubElement(fault, "faultcode").text = f"soap:{self.code}"
        etree.SubElement(fault, "faultstring").text = text_of(self.text)
        if self.detail:
            fault.append(element_of(self.detail, "detail"))
        return etree.tostring(root, encoding="utf-8", xml_declaration=True)


def client_fault(text: str) -> Fault:
    """Return the Client fault for a message that does not match the WSDL (R2724)."""
    return Fault(FaultCode.CLIENT, text)


_ENVELOPE: Final = f"{{{SOAP}}}Envelope"
_HEADER: Final = f"{{{SOAP}}}Header"
_BODY: Final = f"{{{SOAP}}}Body"
_MUST_UNDERSTAND: Final = f"{{{SOAP}}}mustUnderstand"
_ACTOR: Final = f"{{{SOAP}}}actor"

# SOAP 1.1, 4.2.2: without an actor, or with this one, a header block is meant for the receiver of the message.
_FOR_US: Final = frozenset({None, "", "http://schemas.xmlsoap.org/soap/actor/next"})

# WS-Addressing headers are accepted, mandatory or not (contract). The response is sent on the same connection, as an
# anonymous ReplyTo requests. The robot never connects to another address.
_TOLERATED: Final = ("{http://www.w3.org/2005/08/addressing}", "{http://schemas.xmlsoap.org/ws/2004/08/addressing}")


def operation_element(root: etree._Element) -> etree._Element:
    """Return the single child element of the Body, which selects the operation (WS-I BP R1127, R2710).

    Raises:
        Fault: VersionMismatch, MustUnderstand or Client, checked in that order (R2725).
    """
    if root.tag != _ENVELOPE:
        raise _no_envelope(root)
    parts = list(root)
    header = parts.pop(0) if parts and parts[0].tag == _HEADER else None
    blocks = [] if header is None else list(header)
    if header is not None:
        _require_understood(blocks)
    if not parts or parts[0].tag != _BODY:
        raise client_fault("the Envelope has no Body")
    if len(parts) > 1:
        raise client_fault(f"the Envelope has {clip(parts[1].tag)} after its Body (WS-I BP R1011)")
    _require_valid_flags(blocks)
    children = list(parts[0])
    if len(children) != 1:
        raise client_fault(f"the Body must have one element, not {len(children)}")
    return children[0]


def _no_envelope(root: etree._Element) -> Fault:
    """Return the fault for a root element that is not a SOAP 1.1 Envelope (R1015)."""
    if str(root.tag).rpartition("}")[2] == "Envelope":
        return Fault(FaultCode.VERSION_MISMATCH, f"the Envelope must be SOAP 1.1's {_ENVELOPE}, not {clip(root.tag)}")
    return client_fault(f"the document must be a SOAP 1.1 Envelope, not {clip(root.tag)}")


def _require_understood(blocks: list[etree._Element]) -> None:
    for block in blocks:
        mandatory = block.get(_MUST_UNDERSTAND) == "1" and block.get(_ACTOR) in _FOR_US
        if mandatory and not str(block.tag).startswith(_TOLERATED):
            raise Fault(FaultCode.MUST_UNDERSTAND, f"the mandatory header block {clip(block.tag)} is not understood")


def _require_valid_flags(blocks: list[etree._Element]) -> None:
    for block in blocks:
        flag = block.get(_MUST_UNDERSTAND)
        if flag not in {None, "0", "1"}:
            raise client_fault(f"mustUnderstand must be 0 or 1, not {clip(flag)} (WS-I BP R1013)")
