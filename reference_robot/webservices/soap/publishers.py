"""RobotPublishersWebService: the web methods that order deliveries."""

from functools import partial
from typing import Final

from lxml import etree

from conformance.papers_robot.delivery import COFFEE
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.http.access import Scope
from reference_robot.webservices.http.messages import Response
from reference_robot.webservices.robot.deliveries import Deliveries, UnusableFieldError
from reference_robot.webservices.soap.envelope import client_fault
from reference_robot.webservices.soap.service import SoapService

PATH: Final = "/turtlesim_publisher_ws"

# The fields in the order of the XSD's sequence, so that seven names need not be read from a valid message, which takes
# 2 µs. Apart from the code, the ROS message has the same order.
_ORDER: Final = ("depot_x", "depot_y", "destination_x", "destination_y", "message_code", "source_x", "source_y")
_CODE: Final = _ORDER.index("message_code")


class PublishersWebService(SoapService):
    """The operations ExecuteDeliveryRequest and ExecuteCoffeeRequest, which return an empty response (paper)."""

    scope = Scope.DELIVER

    def __init__(self, deliveries: Deliveries) -> None:
        codes = {"ExecuteDeliveryRequest": None, "ExecuteCoffeeRequest": COFFEE}
        super().__init__("publishers", PATH, {name: partial(self._execute, name, code) for name, code in codes.items()})
        self._deliveries = deliveries
        self._done = {name: self.response(name) for name in codes}

    def _execute(self, operation: str, code: int | None, wrapper: etree._Element) -> Response:
        """Publish the delivery request in a schema-valid message; return the empty response.

        The XSD allows ``INF``, ``NaN`` and a missing ``arg0``, so these are checked here.

        Raises:
            Fault: Client, if ``arg0`` is missing.
            Problem: 422 for an invalid field; 503 as ``Deliveries.accept``.
        """
        if not len(wrapper):
            raise client_fault("arg0, which holds the delivery request, is missing")
        sent = [element.text or "" for element in wrapper[0]]
        try:
            self._deliveries.accept(_request(sent, code), "soap")
        except UnusableFieldError as error:
            raise error.refusal(error.field, sent[_ORDER.index(error.field)]) from error
        return self._done[operation]


def _request(sent: list[str], code: int | None) -> DeliveryRequest:
    try:
        number = int(sent[_CODE])
    except ValueError as error:  # thousands of leading zeros: valid, but too long for Python's int
        raise UnusableFieldError("message_code", "must be an integer with fewer digits") from error
    return DeliveryRequest(number if code is None else code, *map(float, sent[:_CODE]), *map(float, sent[_CODE + 1 :]))
