"""RobotSubscribersWebService: the web methods that tell the robot's state, each as its REST resource does."""

from typing import Any, Final

from lxml import etree

from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.checking import shown
from reference_robot.webservices.representation.writing import element_of
from reference_robot.webservices.robot.goals import Goals
from reference_robot.webservices.robot.odometry import LatestOdometry
from reference_robot.webservices.robot.plans import Planner, PlanQuery
from reference_robot.webservices.robot.velocity import Velocity
from reference_robot.webservices.soap.description import ServiceDescription
from reference_robot.webservices.soap.faults import SOAP, client_fault
from reference_robot.webservices.soap.service import Operation, SoapService

PATH: Final = "/turtlesim_subscriber_ws"


class SubscribersWebService(SoapService):
    """GetPose, GetVelocity, GetSensors, GetNavigationServices, GetGoal and GetPlan."""

    def __init__(
        self,
        subscribers: RobotSubscribersNode,
        odometry: LatestOdometry,
        velocity: Velocity,
        goals: Goals,
        planner: Planner,
    ) -> None:
        self.path = PATH
        self.description = ServiceDescription("subscribers", PATH)
        self._subscribers = subscribers
        self._odometry = odometry
        self._velocity = velocity
        self._goals = goals
        self._planner = planner
        super().__init__()

    def operations(self) -> dict[str, Operation]:
        """Return the six operations."""
        return {
            "GetPose": lambda _: self._response("GetPose", [self._odometry.plain()]),
            "GetVelocity": lambda _: self._response("GetVelocity", [self._velocity.measured()]),
            "GetSensors": lambda _: self._response("GetSensors", self._subscribers.sensors()),
            "GetNavigationServices": lambda _: self._response(
                "GetNavigationServices", self._subscribers.navigation_services()
            ),
            "GetGoal": lambda _: self._response("GetGoal", [goal] if (goal := self._goals.current()) else []),
            "GetPlan": self._get_plan,
        }

    async def _get_plan(self, wrapper: etree._Element) -> bytes:
        given: dict[str, Any] = {}
        for element in wrapper:
            name, text = str(element.tag), element.text or ""
            given[name] = text if name == "frame_id" else _finite(name, text)
        return self._response("GetPlan", [await self._planner.plan(PlanQuery(**given))])

    def _response(self, operation: str, returned: list[Any]) -> bytes:
        """Return the envelope with one unqualified ``return`` element for each value."""
        namespace = self.description.namespace
        root = etree.Element(f"{{{SOAP}}}Envelope", nsmap={"soap": SOAP})
        wrapper = etree.SubElement(
            etree.SubElement(root, f"{{{SOAP}}}Body"), f"{{{namespace}}}{operation}Response", nsmap={"tns": namespace}
        )
        wrapper.extend([element_of(value, "return") for value in returned])
        return etree.tostring(root, encoding="utf-8", xml_declaration=True)


def _finite(name: str, text: str) -> float:
    """Read a valid xs:double; INF and NaN never enter (contract, REST)."""
    number = float(text)
    if number - number != 0:
        raise client_fault(f"{name} must be finite, not {shown(text)}")
    return number
