"""The paper's delivery request: its fields in the orders that each interface has them, and its codes.

openapi.yaml, publishers.xsd and mybot_delivery_app/DeliveryRequestMsg are the binding form; a test compares.
"""

from typing import Final

#: Message codes.
COURIER: Final = 3
COFFEE: Final = 4

#: Coordinates in metres, in the order of the ROS message and of the REST path.
COORDINATES: Final = ("depot_x", "depot_y", "destination_x", "destination_y", "source_x", "source_y")
#: What the REST path calls them.
PATH_NAMES: Final = ("depot_x", "depot_y", "dest_x", "dest_y", "source_x", "source_y")
#: All fields in the order of the ROS message.
MESSAGE_FIELDS: Final = ("message_code", *COORDINATES)
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
