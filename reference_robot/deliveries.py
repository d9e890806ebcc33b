"""A delivery request, as the simulation and the web services hand it on."""

from typing import NamedTuple


class DeliveryRequest(NamedTuple):
    """The fields of a DeliveryRequestMsg: coordinates in metres in the map frame, every double as it was sent."""

    message_code: int
    depot_x: float
    depot_y: float
    destination_x: float
    destination_y: float
    source_x: float
    source_y: float
