"""The health report: which parts of the robot are available, and how old their data is."""

import asyncio
from dataclasses import dataclass
from typing import Any

from reference_robot.webservices.nodes.calls import ManagedNode
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.robot.odometry import OLDEST, LatestOdometry


@dataclass(frozen=True)
class Health:
    """A reporter on all parts of the robot that requests depend on."""

    publishers: RobotPublishersNode
    subscribers: RobotSubscribersNode
    odometry: LatestOdometry
    navigator: ManagedNode
    planner: ManagedNode

    async def report(self) -> dict[str, Any]:
        """Return a dict with ``available``, and ages in seconds, for each part, and ``healthy`` for the whole robot.

        A robot is healthy if its odometry is less than a second old and the ROS threads run; navigation and the
        delivery application are not required.
        """
        publishers, subscribers = self.publishers, self.subscribers
        hangs = subscribers.ros.hangs()
        age = self.odometry.age()
        is_current = age is not None and age <= OLDEST
        # While a ROS thread hangs, no response would arrive.
        navigator, planner = (
            ("unknown", "unknown") if hangs else await asyncio.gather(self.navigator.state(), self.planner.state())
        )
        if subscribers.plan_service_is_served():
            planned_by = {"by": "service"}
        else:
            planned_by = {"by": "action"} if subscribers.plan_action_is_served() else {}
        return {
            "healthy": is_current and not hangs,
            "ros": {"available": not hangs, "silence": round(subscribers.ros.silence(), 3)},
            "odometry": {"available": is_current} | ({} if age is None else {"age": round(age, 3)}),
            "velocity": {"available": publishers.find_velocity_subscribers()},
            "navigation": {"available": publishers.navigation_is_served(), "state": navigator},
            "planner": {"available": bool(planned_by), "state": planner} | planned_by,
            "localisation": {"available": subscribers.map_transform.latest is not None},
            "delivery": {"available": publishers.delivery_is_served()},
        }
