"""The assembly of the simulated robot: all its nodes on one ROS runtime."""

from reference_robot.kinematics import DIFFERENTIAL, KINEMATICS
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime
from reference_robot.simulation.base import Base
from reference_robot.simulation.delivery import Delivery
from reference_robot.simulation.frames import MapServer
from reference_robot.simulation.localisation import Localisation
from reference_robot.simulation.navigation import Navigation
from reference_robot.simulation.office import OFFICE
from reference_robot.simulation.patrol import Patrol
from reference_robot.simulation.planner import Planner
from reference_robot.simulation.planning import Planning
from reference_robot.simulation.pursuit import EXACT
from reference_robot.simulation.realism import NEAR_ENOUGH, Realism
from reference_robot.simulation.requests import DeliveryRequests
from reference_robot.simulation.sensors import Sensors


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
