"""SOAP as elaborate as the contract lets it be: default namespaces, comments, CDATA, and faults with details."""

from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from lxml import etree

from proof.table1.independent_robots.baroque.rest import SENSORS, SERVICES, fill
from proof.table1.independent_robots.plain import soap
from proof.table1.independent_robots.plain.server import Answer
from proof.table1.independent_robots.plain.soap import SOAP, TNS, FaultError


class Soap(soap.Soap):
    """The SOAP interface of one body."""

    sensors, services = SENSORS, SERVICES
    folder, files = Path(__file__).parent, {"wsdl": "wsdl", "xsd=1": "xsd"}

    def malformed_answer(self, problem: str) -> Answer:
        """Return a fault for content that is no XML."""
        return self.fault("Client", problem)

    def no_goal(self) -> list[Any]:
        """Return a fault which says that there is no goal.

        Raises:
            FaultError: always.
        """
        raise FaultError("Client", "the robot has no goal")

    def response(self, operation: str, values: list[Any]) -> str:
        """Return the response element, whose children are in no namespace although it has a default one."""
        content = "".join(_without_namespace("return", value) for value in values)
        return f'<{operation}Response xmlns="{TNS}"><!-- answered -->{content}</{operation}Response>'

    def envelop(self, status: int, content: str) -> Answer:
        """Return a SOAP message."""
        text = f'<!-- baroque --><Envelope xmlns="{SOAP}"><Body>\n {content}\n </Body></Envelope>'
        return Answer(status, text.encode(), 'text/xml; charset="UTF-8"')

    def fault(self, code: str, text: str) -> Answer:
        """Return a fault with a detail of its own."""
        said = escape("".join(char if char.isprintable() else " " for char in text))
        return self.envelop(
            500,
            f'<Fault><faultcode xmlns="" xmlns:code="{SOAP}">\n code:{code} </faultcode>'
            f'<faultstring xmlns="" xml:lang="en">{said}</faultstring>'
            f'<detail xmlns=""><advice xmlns="urn:example:baroque">see the manual</advice></detail></Fault>',
        )


def _without_namespace(name: str, value: Any) -> str:
    element = etree.Element(name)
    fill(element, value, nested=False)
    return etree.tostring(element, encoding="unicode").replace(f"<{name}", f'<{name} xmlns=""', 1)
