"""The robot's SOAP services: publishers order deliveries; subscribers return the state as REST does."""

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from lxml import etree

from conformance.papers_robot.delivery import COFFEE
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.http.access import Scope
from reference_robot.webservices.http.messages import Response
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.problems import clip
from reference_robot.webservices.robot.deliveries import Deliveries, UnusableFieldError
from reference_robot.webservices.robot.goals import Goals
from reference_robot.webservices.robot.odometry import LatestOdometry
from reference_robot.webservices.robot.plans import Planner, PlanQuery
from reference_robot.webservices.robot.velocity import Velocity
from reference_robot.webservices.soap.envelope import client_fault
from reference_robot.webservices.soap.service import Operation, SoapService

PUBLISHERS_PATH: Final = "/turtlesim_publisher_ws"

# The fields in the order of the XSD's sequence, so that seven names need not be read from a valid message, which takes
# 2 µs. Apart from the code, the ROS message has the same order.
_ORDER: Final = ("depot_x", "depot_y", "destination_x", "destination_y", "message_code", "source_x", "source_y")
_CODE: Final = _ORDER.index("message_code")


class PublishersWebService(SoapService):
    """The operations ExecuteDeliveryRequest and ExecuteCoffeeRequest, which return an empty response (paper)."""

    scope = Scope.DELIVER

    def __init__(self, deliveries: Deliveries) -> None:
        codes = {"ExecuteDeliveryRequest": None, "ExecuteCoffeeRequest": COFFEE}
        super().__init__(
            "publishers", PUBLISHERS_PATH, {name: partial(self._execute, name, code) for name, code in codes.items()}
        )
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


PATH: Final = "/turtlesim_subscriber_ws"


class SubscribersWebService(SoapService):
    """The operations GetPose, GetVelocity, GetSensors, GetNavigationServices, GetGoal and GetPlan."""

    scope = Scope.READ

    def __init__(
        self,
        subscribers: RobotSubscribersNode,
        odometry: LatestOdometry,
        velocity: Velocity,
        goals: Goals,
        planner: Planner,
    ) -> None:
        returned: dict[str, Callable[[], list[Any]]] = {
            "GetVelocity": lambda: [velocity.read()],
            "GetSensors": subscribers.sensors,
            "GetNavigationServices": subscribers.navigation_services,
            "GetGoal": lambda: [goals.active_goal()],
        }
        operations: dict[str, Operation] = {
            name: partial(self._return_values, name, values) for name, values in returned.items()
        }
        operations |= {"GetPose": self._get_pose, "GetPlan": self._get_plan}
        super().__init__("subscribers", PATH, operations)
        self._odometry = odometry
        self._write_pose = lambda pose: self.response("GetPose", [pose])
        self._planner = planner

    def _return_values(self, operation: str, values: Callable[[], list[Any]], _wrapper: etree._Element) -> Response:
        return self.response(operation, values())

    def _get_pose(self, _wrapper: etree._Element) -> Response:
        """Return the latest odometry; each message is serialized to XML at most once."""
        return self._odometry.write_latest(self._write_pose)

    async def _get_plan(self, wrapper: etree._Element) -> Response:
        given: dict[str, Any] = {}
        for element in wrapper:
            name, text = str(element.tag), element.text or ""
            given[name] = text if name == "frame_id" else _finite(name, text)
        return self.response("GetPlan", [await self._planner.plan(PlanQuery(**given))])


def _finite(name: str, text: str) -> float:
    """Return a schema-valid xs:double as float; raise a Client fault for INF and NaN (contract, REST)."""
    number = float(text)
    if number - number != 0:
        raise client_fault(f"{name} must be finite, not {clip(text)}")
    return number
