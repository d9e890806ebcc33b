"""The delivery application's resources: the paper's PUT, and the list of what was accepted."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, ClassVar, Final
from urllib.parse import unquote_to_bytes

from reference_robot.webservices.nodes.publishers import (
    COFFEE_DELIVERY_MESSAGE_CODE,
    COURIER_DELIVERY_MESSAGE_CODE,
)
from reference_robot.webservices.representation.checking import shown
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.representation.reading import NUMBER
from reference_robot.webservices.resources.resource import (
    NO_CONTENT,
    Resource,
    represented,
    wanted_format,
)
from reference_robot.webservices.robot.deliveries import Deliveries, DeliveryRequest

if TYPE_CHECKING:
    from reference_robot.webservices.http.messages import Request, Response

CODES: Final = frozenset({COURIER_DELIVERY_MESSAGE_CODE, COFFEE_DELIVERY_MESSAGE_CODE})

_SEGMENT_NAMES: Final = ("depot_x", "depot_y", "dest_x", "dest_y", "source_x", "source_y")
_PREFIX: Final = "/robot/app/delivery/"
_ANY: Final = re.compile((f"{_PREFIX}([^/]*)" + "".join(f"/{name}/([^/]*)" for name in _SEGMENT_NAMES)).encode())
_WELL_FORMED: Final = re.compile(
    (f"{_PREFIX}([+-]?[0-9]{{1,40}})" + "".join(f"/{name}/({NUMBER})" for name in _SEGMENT_NAMES)).encode()
)
_CODE: Final = re.compile(r"[+-]?[0-9]{1,40}")
_NUMBER: Final = re.compile(NUMBER)


class Delivery(Resource):
    """PUT publishes one DeliveryRequestMsg. The only resource with values in its path."""

    path: ClassVar = _PREFIX + "{code}" + "".join(f"/{name}/{{{name}}}" for name in _SEGMENT_NAMES)

    def __init__(self, deliveries: Deliveries) -> None:
        self._deliveries = deliveries

    @staticmethod
    def owns(path: bytes) -> bool:
        """Tell whether a raw path has this resource's form, whatever its values."""
        return _ANY.fullmatch(path) is not None

    def put(self, request: Request) -> Response:
        """Accept a delivery, 204; a body is ignored. 422 for codes other than 3 and 4 and for bad numbers."""
        match = _WELL_FORMED.fullmatch(request.path)
        if match is None:
            delivery = _spelled_out(request.path)
        else:
            code, depot_x, depot_y, dest_x, dest_y, source_x, source_y = match.groups()
            delivery = DeliveryRequest(
                int(code),
                float(depot_x),
                float(depot_y),
                float(dest_x),
                float(dest_y),
                float(source_x),
                float(source_y),
            )
        check(delivery)
        self._deliveries.accept(delivery, "rest")
        return NO_CONTENT


class DeliveryList(Resource):
    """The requests accepted last, newest first, with their state: an extension of the contract."""

    path: ClassVar = _PREFIX

    def __init__(self, deliveries: Deliveries) -> None:
        self._deliveries = deliveries

    def get(self, request: Request) -> Response:
        """Return the list."""
        return represented(self._deliveries.listed(), "Deliveries", wanted_format(request))


def check(request: DeliveryRequest) -> None:
    """Raise the 422 for a code that is no delivery's and for a coordinate that is not finite."""
    if request.message_code not in CODES:
        raise Problem(422, f"code must be 3 (courier) or 4 (coffee), not {request.message_code}")
    if not math.isfinite(sum(request)):
        # Finite doubles may add up to an infinity; so look closer before refusing.
        for name, value in zip(_SEGMENT_NAMES, request[1:], strict=True):
            if not math.isfinite(value):
                raise Problem(422, f"{name} must be finite, not {value}")


def _spelled_out(path: bytes) -> DeliveryRequest:
    """Read the values one by one: percent-encoded ones, and bad ones, which are named."""
    match = _ANY.fullmatch(path)
    if match is None:
        raise Problem(404, "no such delivery")
    code, *coordinates = (unquote_to_bytes(group).decode("utf-8", "replace") for group in match.groups())
    if not _CODE.fullmatch(code):
        raise Problem(422, f"code must be an integer, not {shown(code)}")
    numbers = []
    for name, text in zip(_SEGMENT_NAMES, coordinates, strict=True):
        if not _NUMBER.fullmatch(text):
            raise Problem(422, f"{name} must be a number, not {shown(text)}")
        numbers.append(float(text))
    return DeliveryRequest(int(code), *numbers)
