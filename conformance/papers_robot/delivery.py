"""The paper's delivery request: its fields in the orders that each interface has them, and its codes.

openapi.yaml, publishers.xsd and mybot_delivery_app/DeliveryRequestMsg are the binding form; a test compares.
"""

from typing import Final, NamedTuple

#: Message codes.
COURIER: Final = 3
COFFEE: Final = 4


class DeliveryFields(NamedTuple):
    """The fields of a mybot_delivery_app/DeliveryRequestMsg in its order; coordinates in metres, in the map frame."""

    message_code: int
    depot_x: float
    depot_y: float
    destination_x: float
    destination_y: float
    source_x: float
    source_y: float


#: All fields in the order of the ROS message.
MESSAGE_FIELDS: Final = DeliveryFields._fields
#: Coordinates in metres, in the order of the ROS message and of the REST path.
COORDINATES: Final = MESSAGE_FIELDS[1:]
#: Names of these fields in the REST path.
PATH_NAMES: Final = ("depot_x", "depot_y", "dest_x", "dest_y", "source_x", "source_y")
#: All fields in the order of the XSD's sequence, deliveryRequestMessage.
XSD_FIELDS: Final = ("depot_x", "depot_y", "destination_x", "destination_y", "message_code", "source_x", "source_y")
#: The paper's example client call.
EXAMPLE: Final = {
    "depot_x": 68.269,
    "depot_y": 38.718,
    "destination_x": 60.633,
    "destination_y": 37.51,
    "source_x": 76.02,
    "source_y": 41.35,
}
