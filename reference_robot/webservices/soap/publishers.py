"""RobotPublishersWebService: the web methods that make the robot act."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from reference_robot.webservices.nodes.publishers import COFFEE_DELIVERY_MESSAGE_CODE
from reference_robot.webservices.resources.delivery import check
from reference_robot.webservices.robot.deliveries import Deliveries, DeliveryRequest
from reference_robot.webservices.soap.description import ServiceDescription
from reference_robot.webservices.soap.faults import SOAP, client_fault
from reference_robot.webservices.soap.service import SoapService

if TYPE_CHECKING:
    from lxml import etree

    from reference_robot.webservices.soap.service import Operation

PATH: Final = "/turtlesim_publisher_ws"


class PublishersWebService(SoapService):
    """ExecuteDeliveryRequest and ExecuteCoffeeRequest: both return nothing (paper), the empty wrapper.

    Args:
        deliveries: Takes the requests.
    """

    def __init__(self, deliveries: Deliveries) -> None:
        self.path = PATH
        self.description = ServiceDescription("publishers", PATH)
        self._deliveries = deliveries
        self._done = {name: self._empty_response(name) for name in self.operations()}
        super().__init__()

    def operations(self) -> dict[str, Operation]:
        """Return the two operations."""
        return {
            "ExecuteDeliveryRequest": self._execute_delivery,
            "ExecuteCoffeeRequest": self._execute_coffee,
        }

    def _execute_delivery(self, wrapper: etree._Element) -> bytes:
        request = _request(wrapper)
        check(request)
        self._deliveries.accept(request, "soap")
        return self._done["ExecuteDeliveryRequest"]

    def _execute_coffee(self, wrapper: etree._Element) -> bytes:
        request = _request(wrapper)._replace(message_code=COFFEE_DELIVERY_MESSAGE_CODE)
        check(request)
        self._deliveries.accept(request, "soap")
        return self._done["ExecuteCoffeeRequest"]

    def _empty_response(self, operation: str) -> bytes:
        return (
            f'<soap:Envelope xmlns:soap="{SOAP}"><soap:Body>'
            f'<tns:{operation}Response xmlns:tns="{self.description.namespace}"/>'
            "</soap:Body></soap:Envelope>"
        ).encode()


def _request(wrapper: etree._Element) -> DeliveryRequest:
    """Read a wrapper that is valid by the XSD; its values may still be INF or NaN, which ``check`` refuses.

    Raises:
        Fault: Client, where the optional ``arg0`` is missing: there is nothing to deliver.
    """
    if not len(wrapper):
        raise client_fault("arg0 is missing: it holds the delivery request")
    # XML Schema's sequence: depot_x, depot_y, destination_x, destination_y, message_code, source_x, source_y.
    depot_x, depot_y, dest_x, dest_y, code, source_x, source_y = (part.text or "" for part in wrapper[0])
    try:
        return DeliveryRequest(
            int(code),
            float(depot_x),
            float(depot_y),
            float(dest_x),
            float(dest_y),
            float(source_x),
            float(source_y),
        )
    except ValueError as error:  # thousands of leading zeros: valid, and more than Python reads as an integer
        raise client_fault(f"message_code is not read: {error}") from error
