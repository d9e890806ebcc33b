"""The messages of RoAAS's own contract that its robots take, with the paper's values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from conformance.documents.xml_names import clark
from conformance.documents.xml_node import Node
from conformance.soap.calls import call
from conformance.soap.content import number_at

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conformance.documents.wsdl import Operation
    from conformance.soap.service import SoapService

NAMESPACE: Final = "http://soap.turtlebot.mybot.org/"
COURIER: Final = 3
COFFEE: Final = 4
# The paper's example client call, in the order of the XSD.
COORDINATES: Final = {
    "depot_x": "68.269",
    "depot_y": "38.718",
    "destination_x": "60.633",
    "destination_y": "37.51",
    "source_x": "76.02",
    "source_y": "41.35",
}
FIELDS: Final = ("depot_x", "depot_y", "destination_x", "destination_y", "message_code", "source_x", "source_y")
# Where message_code stands in the wrapper: in arg0, the fifth.
CODE_PATH: Final = (0, 4)


def delivery(operation: str = "ExecuteDeliveryRequest", code: str = "4", **coordinates: str) -> Node:
    """A delivery request.

    Args:
        operation: ExecuteDeliveryRequest or ExecuteCoffeeRequest.
        code: as written.
        coordinates: those that differ from the paper's, as written.
    """
    values = {**COORDINATES, **coordinates, "message_code": code}
    argument = Node("arg0", "", tuple(Node(name, values[name]) for name in FIELDS))
    return Node(clark(NAMESPACE, operation), "", (argument,))


def plan(x: float, y: float, **others: str) -> Node:
    """A GetPlan request; further arguments as written."""
    names = ("yaw", "frame_id", "tolerance", "start_x", "start_y", "start_yaw")
    given = [Node("x", repr(x)), Node("y", repr(y))] + [Node(name, others[name]) for name in names if name in others]
    return Node(clark(NAMESPACE, "GetPlan"), "", tuple(given))


def position(service: SoapService) -> tuple[float, float] | None:
    """Where GetPose says that the robot is, in its odometry frame, m; None where it does not say.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    answer = call(service, Node(clark(NAMESPACE, "GetPose")))
    first = answer.envelope.first if answer.taken and answer.envelope else None
    if first is None:
        return None
    x = number_at(first, "pose", "pose", "position", "x")
    y = number_at(first, "pose", "pose", "position", "y")
    return None if x is None or y is None else (x, y)


def examples(service: SoapService, operation: Operation) -> Iterator[Node]:
    """Messages that a robot takes, likeliest first; none for operations that need none but the obvious.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    if operation.name in {"ExecuteCoffeeRequest", "ExecuteDeliveryRequest"}:
        yield delivery(operation.name)
    elif operation.name == "GetPlan":
        here = position(service)
        if here is not None:
            for east, north in ((0.0, 0.0), (0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)):
                yield plan(here[0] + east, here[1] + north)
