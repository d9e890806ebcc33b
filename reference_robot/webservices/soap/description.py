"""The WSDL and XSD of a SOAP service: sent to clients with the robot's address, and used to validate messages."""

from typing import Any, Final

from lxml import etree

from conformance.papers_robot.statement import CONTRACT_DIR
from reference_robot.webservices.representation.checking import shown
from reference_robot.webservices.soap.faults import client_fault

_WSDL_SOAP: Final = "{http://schemas.xmlsoap.org/wsdl/soap/}"
_XSD: Final = "{http://www.w3.org/2001/XMLSchema}"
_ERRORS_SHOWN: Final = 3


class ServiceDescription:
    """The WSDL and XSD of one service of the contract, ``publishers`` or ``subscribers``, at a path."""

    def __init__(self, name: str, path: str) -> None:
        self._path = path
        self._wsdl = etree.parse(CONTRACT_DIR / f"{name}.wsdl")
        self.xsd = (CONTRACT_DIR / f"{name}.xsd").read_bytes()
        document = etree.fromstring(self.xsd)
        self.namespace = str(document.get("targetNamespace"))
        self._schema = etree.XMLSchema(document)

    def wsdl(self, base: str) -> bytes:
        """Return the WSDL with the robot's address (WS-I BP R2001) and the location ``?xsd=1`` of its schema."""
        for address in self._wsdl.iter(f"{_WSDL_SOAP}address"):
            address.set("location", base + self._path)
        for schema in self._wsdl.iter(f"{_XSD}import"):
            schema.set("schemaLocation", f"{base}{self._path}?xsd=1")
        return etree.tostring(self._wsdl, encoding="utf-8", xml_declaration=True)

    def require_valid(self, element: etree._Element) -> None:
        """Raise a Client fault for an element that is invalid by the XSD (R2724)."""
        if not self._schema.validate(element):
            # libxml2's texts quote only names and values of the message, nothing internal to the robot.
            log: Any = self._schema.error_log
            errors = "; ".join(entry.message for entry in log[:_ERRORS_SHOWN])
            raise client_fault(f"{shown(element.tag)} is not valid by the XSD: {errors}")
