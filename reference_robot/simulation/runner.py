"""The assembly of the simulated robot: all its nodes on one ROS runtime."""

import itertools
from typing import Any, Final

from action_msgs.msg import GoalStatus
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.node import Node
from std_msgs.msg import Header

from reference_robot.kinematics import DIFFERENTIAL, KINEMATICS
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime
from reference_robot.simulation.base import Base, MapServer
from reference_robot.simulation.delivery import Delivery, DeliveryRequests
from reference_robot.simulation.messages import Localisation, stamped_pose
from reference_robot.simulation.navigation import EXACT, Navigation
from reference_robot.simulation.office import OFFICE
from reference_robot.simulation.planner import Planner
from reference_robot.simulation.planning import Planning
from reference_robot.simulation.realism import NEAR_ENOUGH, Realism
from reference_robot.simulation.sensors import Sensors

_PLACES: Final = ((68.0, 39.0, 0.0), (72.0, 39.0, 3.0))  # of the corridor
_RETRY_PERIOD_S: Final = 0.2


class Simulation:
    """The simulated robot: the ROS nodes ``base``, ``navigation`` and ``delivery`` on a runtime. ROS time is wall time.

    With ``realism`` the robot has the imperfections of a real one; ``kinematics`` names another body.

    Raises:
        ValueError: The time scale is not positive.
    """

    def __init__(
        self,
        ros: RosRuntime,
        names: RosNames,
        time_scale: float = 1.0,
        realism: Realism | None = None,
        kinematics: str = DIFFERENTIAL,
    ) -> None:
        if not time_scale > 0:
            raise ValueError(f"the time scale must be positive, not {time_scale}")
        base_node = ros.create_node("base")
        body = KINEMATICS[kinematics]
        self.base = Base(base_node, names, time_scale, realism, None if realism else body)
        self.sensors = Sensors(base_node, names, lambda: self.base.motion)
        navigation_node = ros.create_node("navigation")
        self.map = MapServer(navigation_node, names)
        planner = Planner(OFFICE)
        localisation = Localisation(navigation_node, names)
        self.planning = Planning(navigation_node, names, planner, localisation)
        tolerances = NEAR_ENOUGH if realism else EXACT
        self.navigation = Navigation(navigation_node, names, planner, localisation, time_scale, tolerances, body)
        requests = DeliveryRequests(ros, names)
        self.delivery = Delivery(ros.create_node("delivery", apart=True), requests, names)
        if body.patrols:
            self.patrol = Patrol(navigation_node, names)


class Patrol:
    """An action client that sends the robot to one place after the other; another client's goal ends it as well."""

    def __init__(self, node: Node, names: RosNames) -> None:
        self._frame = names.frames.map
        self._places = itertools.cycle(_PLACES)
        self._navigate = ActionClient(node, NavigateToPose, names.actions.navigate_to_pose)
        self._begin = node.create_timer(_RETRY_PERIOD_S, self._go)

    def _go(self) -> None:
        if not self._navigate.server_is_ready():
            return
        self._begin.cancel()
        pose = stamped_pose(next(self._places), Header(frame_id=self._frame))
        self._navigate.send_goal_async(NavigateToPose.Goal(pose=pose)).add_done_callback(self._on_accepted)

    def _on_accepted(self, sent: Any) -> None:
        handle = sent.result()
        if handle is not None and handle.accepted:
            handle.get_result_async().add_done_callback(self._on_end)

    def _on_end(self, result: Any) -> None:
        if result.result().status == GoalStatus.STATUS_SUCCEEDED:
            self._begin.reset()
