"""The odometry received last: where the robot is and how fast it moves, as it measures itself."""

from typing import Any

from nav_msgs.msg import Odometry

from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.messages import reader_of
from reference_robot.webservices.representation.problems import not_yet


class LatestOdometry:
    """Tells what the robot measures."""

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers
        self._read = reader_of(Odometry)

    def message(self) -> Odometry:
        """Return the message received last, another object for each.

        Raises:
            Problem: 503 before the first.
        """
        message = self._subscribers.odometry
        if message is None:
            raise not_yet("the robot has not published its odometry yet")
        return message

    def plain(self) -> dict[str, Any]:
        """Return it as a plain nav_msgs/Odometry; raises the 503 also where a value in it is not finite."""
        return self._read(self.message())
