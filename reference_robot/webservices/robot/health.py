"""The health report: which parts of the robot are available, and how old their data is."""

import asyncio
from typing import Any

from reference_robot.webservices.nodes.lifecycle import ManagedNode
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.robot.odometry import OLDEST, LatestOdometry


class Health:
    """A reporter on all parts of the robot that requests depend on."""

    def __init__(
        self,
        publishers: RobotPublishersNode,
        subscribers: RobotSubscribersNode,
        odometry: LatestOdometry,
        navigator: ManagedNode,
        planner: ManagedNode,
    ) -> None:
        self._publishers = publishers
        self._subscribers = subscribers
        self._odometry = odometry
        self._navigator = navigator
        self._planner = planner

    async def report(self) -> dict[str, Any]:
        """Return a dict with ``available``, and ages in seconds, for each part, and ``healthy`` for the whole robot.

        A robot is healthy if its odometry is less than a second old and the ROS threads run; navigation and the
        delivery application are not required.
        """
        publishers, subscribers = self._publishers, self._subscribers
        hangs = subscribers.hangs()
        age = self._odometry.age()
        is_current = age is not None and age <= OLDEST
        # While a ROS thread hangs, no response would arrive.
        navigator, planner = (
            ("unknown", "unknown") if hangs else await asyncio.gather(self._navigator.state(), self._planner.state())
        )
        served = [
            kind
            for kind, is_served in (
                ("service", subscribers.plan_service_is_served),
                ("action", subscribers.plan_action_is_served),
            )
            if is_served()
        ]
        return {
            "healthy": is_current and not hangs,
            "ros": {"available": not hangs, "silence": round(subscribers.silence(), 3)},
            "odometry": {"available": is_current} | ({} if age is None else {"age": round(age, 3)}),
            "velocity": {"available": publishers.find_velocity_subscribers()},
            "navigation": {"available": publishers.navigation_is_served(), "state": navigator},
            "planner": {"available": bool(served), "state": planner} | ({"by": served[0]} if served else {}),
            "localisation": {"available": subscribers.map_transform.latest is not None},
            "delivery": {"available": publishers.delivery_is_served()},
        }
