"""The requests of this contract's SOAP services: values put into the shapes that its XSD has."""

from functools import cache
from typing import Final

from conformance.api.soap.messages import filled
from conformance.documents.wsdl import read_file
from conformance.documents.xml_names import clark
from conformance.documents.xml_node import Node
from conformance.documents.xsd_shapes import Element
from conformance.packs.table1.delivery import EXAMPLE
from conformance.packs.table1.files import CONTRACT_DIR

NAMESPACE: Final = "http://soap.turtlebot.mybot.org/"


def request(operation: str, **values: float | str) -> Node:
    """Return a request, its elements in the order of the XSD.

    Args:
        operation: its name.
        values: by the element's name; numbers in the shortest form that gives them back, texts as written. An element
            without a value is left out.
    """
    texts = {name: value if isinstance(value, str) else repr(value) for name, value in values.items()}
    return filled(_shape(operation), texts)


def delivery(operation: str = "ExecuteDeliveryRequest", code: str = "4", **coordinates: str) -> Node:
    """Return a delivery request.

    Args:
        operation: ExecuteDeliveryRequest or ExecuteCoffeeRequest.
        code: as written.
        coordinates: those that differ from the paper's, as written.
    """
    return request(operation, **(EXAMPLE | coordinates), message_code=code)


@cache
def _shape(operation: str) -> Element:
    for service in ("publishers", "subscribers"):
        shape = read_file(CONTRACT_DIR / f"{service}.wsdl").shape(clark(NAMESPACE, operation))
        if shape is not None:
            return shape
    raise KeyError(operation)
