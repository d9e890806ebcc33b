"""RobotSubscribersWebService: the web methods that return the robot's state, each equal to its REST resource."""

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from lxml import etree

from reference_robot.webservices.http.access import Scope
from reference_robot.webservices.http.messages import Response
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.problems import clip
from reference_robot.webservices.robot.goals import Goals
from reference_robot.webservices.robot.odometry import LatestOdometry
from reference_robot.webservices.robot.plans import Planner, PlanQuery
from reference_robot.webservices.robot.velocity import Velocity
from reference_robot.webservices.soap.envelope import client_fault
from reference_robot.webservices.soap.service import Operation, SoapService

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
