"""SOAP faults (SOAP 1.1, 4.4)."""

from enum import StrEnum
from typing import Any, Final

from lxml import etree

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
