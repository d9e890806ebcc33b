"""Send deliveries to the robot's SOAP services, by the contract's XSD, and read its state from them."""

from collections.abc import Iterator
from functools import cache
from typing import Final

from lxml import etree

from conformance.api.soap.calls import call, read_exchange, send
from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import message_of
from conformance.api.soap.service import MEDIA_TYPE, SoapService
from conformance.api.soap.valid_messages import call_valid, require_valid_message
from conformance.api.soap.xml_style import XmlStyle, serialize
from conformance.documents.wsdl import SoapOperation, read_file
from conformance.documents.xml import Node, clark, elements, local
from conformance.documents.xsd_shapes import Element
from conformance.packs.table1.robot.delivery import Delivery
from conformance.papers_robot.delivery import COFFEE, EXAMPLE
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.transport.exchange import Exchange, Outgoing
from conformance.transport.parallel import Addressed

NAMESPACE: Final = "http://soap.turtlebot.mybot.org/"


def request(operation: str, **values: float | str) -> Node:
    """Return a SOAP request with its elements in the order of the XSD.

    Args:
        operation: the operation's name.
        values: value of each element by name: numbers are written in the shortest exact notation, texts as they are. An
            element without a value is left out.
    """
    texts = {name: value if isinstance(value, str) else repr(value) for name, value in values.items()}
    return message_of(_shape(operation), texts)


def delivery(operation: str = "ExecuteDeliveryRequest", code: str = "4", **coordinates: str) -> Node:
    """Return a SOAP delivery request.

    Args:
        operation: ExecuteDeliveryRequest or ExecuteCoffeeRequest.
        code: the delivery code, as text.
        coordinates: coordinates, as text, that differ from those of the paper's example.
    """
    return request(operation, **(EXAMPLE | coordinates), message_code=code)


@cache
def _shape(operation: str) -> Element:
    for service in ("publishers", "subscribers"):
        shape = read_file(CONTRACT_DIR / f"{service}.wsdl").shape(clark(NAMESPACE, operation))
        if shape is not None:
            return shape
    raise KeyError(operation)


# Places to which a robot may have a plan, relative to the robot, m.
_NEAR = ((0.0, 0.0), (0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5))


def send_delivery(
    publishers: SoapService, values: Delivery, *, coffee: bool = False, style: XmlStyle | None = None
) -> Exchange:
    """Send a delivery once, on a new connection so that no retry can send it twice.

    Args:
        publishers: the SOAP service.
        values: the delivery.
        coffee: use ExecuteCoffeeRequest, which implies the delivery code.
        style: how the XML is written.
    """
    operation = "ExecuteCoffeeRequest" if coffee else "ExecuteDeliveryRequest"
    given = values._asdict() | ({"message_code": COFFEE} if coffee else {})
    message = envelope((require_valid_message(publishers, request(operation, **given)),))
    return send(publishers, message if style is None else serialize(message, style), fresh=True).exchange


def delivery_outgoing(publishers: SoapService, values: Delivery, *, coffee: bool = False) -> Addressed:
    """Return a delivery as a request to be sent at the same time as others."""
    operation = "ExecuteCoffeeRequest" if coffee else "ExecuteDeliveryRequest"
    given = values._asdict() | ({"message_code": COFFEE} if coffee else {})
    return outgoing(publishers, request(operation, **given))


def outgoing(service: SoapService, payload: Node) -> Addressed:
    """Return a SOAP call as a request to be sent at the same time as others."""
    headers = (("Content-Type", MEDIA_TYPE), ("SOAPAction", '""'))
    message = envelope((require_valid_message(service, payload),)).serialize()
    return service.client, Outgoing("POST", service.path, headers, message)


def ask(subscribers: SoapService, operation: str, **parameters: float | str) -> Exchange:
    """Call an operation of the subscribers service."""
    return call_valid(subscribers, request(operation, **parameters)).exchange


def text_at(element: etree._Element, *names: str) -> str | None:
    """Return the text at a path of local names, which may be nested in other elements, or None."""
    found = element.findtext(".//" + "/".join(f"{{*}}{name}" for name in names))
    return None if found is None else found.strip()


def returns(exchange: Exchange) -> tuple[list[etree._Element], str]:
    """Return the ``return`` elements of a response, and the fault of a response without any."""
    answer = read_exchange(exchange)
    if not answer.is_taken or answer.first is None:
        return [], f"no SOAP response: {exchange.came}"
    return [child for child in elements(answer.first) if local(str(child.tag)) == "return"], ""


def position(subscribers: SoapService) -> tuple[float, float] | None:
    """Call GetPose and return the position in the odometry frame, m, or None.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    answer = call(subscribers, request("GetPose"))
    if not answer.is_taken or answer.first is None:
        return None
    try:
        x, y = (float(text_at(answer.first, "pose", "pose", "position", axis) or "") for axis in "xy")
    except ValueError:
        return None
    return x, y


def known_messages(service: SoapService, operation: SoapOperation) -> Iterator[Node]:
    """Yield messages that the robot is likely to accept for an operation; none where the generic suite finds its own.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    if service.contract.target_namespace != NAMESPACE:
        return
    if operation.name in {"ExecuteCoffeeRequest", "ExecuteDeliveryRequest"}:
        yield delivery(operation.name)
    elif operation.name == "GetPlan":
        here = position(service)
        if here is not None:
            for east, north in _NEAR:
                yield request("GetPlan", x=here[0] + east, y=here[1] + north)
