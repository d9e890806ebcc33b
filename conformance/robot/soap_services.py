"""The robot's SOAP services as the checks of its domain ask them: deliveries are sent, states read as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final
from xml.sax.saxutils import escape

from conformance.documents.xml import elements
from conformance.documents.xml_names import local
from conformance.robot.delivery import COFFEE, Delivery
from conformance.soap.envelope import Envelope, read_answer

if TYPE_CHECKING:
    from lxml import etree

    from conformance.soap.service import SoapService
    from conformance.transport.exchange import Exchange

_ENVELOPE: Final = "http://schemas.xmlsoap.org/soap/envelope/"
_NAMESPACE: Final = "http://soap.turtlebot.mybot.org/"
# In the order of the contract's XSD.
_SEQUENCE: Final = ("depot_x", "depot_y", "destination_x", "destination_y", "message_code", "source_x", "source_y")


def message(operation: str, content: str = "") -> bytes:
    """A request of an operation, with its children as XML."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        f'<s:Envelope xmlns:s="{_ENVELOPE}" xmlns:t="{_NAMESPACE}"><s:Body>'
        f"<t:{operation}>{content}</t:{operation}></s:Body></s:Envelope>"
    ).encode()


def send_delivery(publishers: SoapService, delivery: Delivery, *, coffee: bool = False) -> Exchange:
    """Send a delivery once, on a connection of its own so that nothing is sent again.

    Args:
        publishers: the service.
        delivery: its values.
        coffee: by ExecuteCoffeeRequest, which knows the code by itself.
    """
    values = delivery._asdict() | ({"message_code": COFFEE} if coffee else {})
    children = "".join(f"<{name}>{values[name]!r}</{name}>" for name in _SEQUENCE)
    operation = "ExecuteCoffeeRequest" if coffee else "ExecuteDeliveryRequest"
    return publishers.post(message(operation, f"<arg0>{children}</arg0>"), fresh=True)


def ask(subscribers: SoapService, operation: str, **parameters: float | str) -> Exchange:
    """Ask the subscribers service; parameters in the order of the contract's XSD."""
    content = "".join(
        f"<{name}>{escape(value) if isinstance(value, str) else repr(float(value))}</{name}>"
        for name, value in parameters.items()
    )
    return subscribers.post(message(operation, content))


def returned(exchange: Exchange) -> tuple[list[etree._Element], str]:
    """The ``return`` elements of a response, and what is wrong where it is none."""
    read: Envelope | None = read_answer(exchange)
    if not exchange.response.ok or read is None or read.first is None or read.fault:
        return [], f"no SOAP response: {exchange.came}"
    return [child for child in elements(read.first) if local(str(child.tag)) == "return"], ""
