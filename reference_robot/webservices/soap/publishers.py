"""RobotPublishersWebService: the web methods that make the robot act."""

from typing import Final

from lxml import etree

from conformance.contract.delivery import COFFEE, COORDINATES
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.robot.deliveries import Deliveries, UnusableFieldError
from reference_robot.webservices.soap.description import ServiceDescription
from reference_robot.webservices.soap.faults import SOAP, client_fault
from reference_robot.webservices.soap.service import Operation, SoapService

PATH: Final = "/turtlesim_publisher_ws"


class PublishersWebService(SoapService):
    """ExecuteDeliveryRequest and ExecuteCoffeeRequest: both return nothing (paper), the empty wrapper."""

    def __init__(self, deliveries: Deliveries) -> None:
        self.path = PATH
        self.description = ServiceDescription("publishers", PATH)
        self._deliveries = deliveries
        self._done = {name: self._empty_response(name) for name in self.operations()}
        super().__init__()

    def operations(self) -> dict[str, Operation]:
        """Return the two operations."""
        return {"ExecuteDeliveryRequest": self._execute_delivery, "ExecuteCoffeeRequest": self._execute_coffee}

    def _execute_delivery(self, wrapper: etree._Element) -> bytes:
        self._accept(wrapper)
        return self._done["ExecuteDeliveryRequest"]

    def _execute_coffee(self, wrapper: etree._Element) -> bytes:
        self._accept(wrapper, COFFEE)
        return self._done["ExecuteCoffeeRequest"]

    def _accept(self, wrapper: etree._Element, code: int | None = None) -> None:
        """Hand over a request that is valid by the XSD, which allows ``INF``, ``NaN`` and a missing ``arg0``.

        Raises:
            Fault: Client, where ``arg0`` is missing: there is nothing to deliver.
            Problem: As ``Deliveries.accept``; 422 for what no delivery may have.
        """
        if not len(wrapper):
            raise client_fault("arg0 is missing: it holds the delivery request")
        sent = {str(element.tag): element.text or "" for element in wrapper[0]}
        try:
            self._deliveries.accept(_request(sent, code), "soap")
        except UnusableFieldError as error:
            raise error.refusal(error.field, sent[error.field]) from error

    def _empty_response(self, operation: str) -> bytes:
        return (
            f'<soap:Envelope xmlns:soap="{SOAP}"><soap:Body>'
            f'<tns:{operation}Response xmlns:tns="{self.description.namespace}"/>'
            "</soap:Body></soap:Envelope>"
        ).encode()


def _request(sent: dict[str, str], code: int | None) -> DeliveryRequest:
    try:
        asked = int(sent["message_code"])
    except ValueError as error:  # thousands of leading zeros: valid, and more than Python reads as an integer
        raise UnusableFieldError("message_code", "must be an integer of fewer digits") from error
    return DeliveryRequest(asked if code is None else code, *(float(sent[name]) for name in COORDINATES))
