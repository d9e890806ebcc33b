"""Build the requests of this contract's SOAP services, in the structure of its XSD."""

from functools import cache
from typing import Final

from conformance.api.soap.messages import filled
from conformance.documents.wsdl import read_file
from conformance.documents.xml import Node, clark
from conformance.documents.xsd_shapes import Element
from conformance.papers_robot.delivery import EXAMPLE
from conformance.papers_robot.statement import CONTRACT_DIR

NAMESPACE: Final = "http://soap.turtlebot.mybot.org/"


def request(operation: str, **values: float | str) -> Node:
    """Return a SOAP request with its elements in the order of the XSD.

    Args:
        operation: the operation's name.
        values: value of each element by name: numbers are written in the shortest exact notation, texts as they are. An
            element without a value is left out.
    """
    texts = {name: value if isinstance(value, str) else repr(value) for name, value in values.items()}
    return filled(_shape(operation), texts)


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
