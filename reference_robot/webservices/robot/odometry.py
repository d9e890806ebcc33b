"""The odometry received last: where the robot is and how fast it moves, as it measures itself."""

from time import monotonic
from typing import Any, Final

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.messages import reader_of
from reference_robot.webservices.representation.problems import not_yet

OLDEST: Final = 1.0  # seconds; what is older is no odometry (contract, REST)


class LatestOdometry:
    """Tells what the robot measures."""

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers
        self._read = reader_of(Odometry)
        self._octets: bytes | None = None
        self._message: Any = None  # what they say

    def message(self) -> Odometry:
        """Return the message received last, another object for each.

        Its age is counted from its arrival, by this machine's clock: a robot's own clock may be another one.

        Raises:
            Problem: 503 before the first, and while the last is older than a second, be it that the robot fell silent
                or that ROS's thread in this process hangs.
        """
        octets, received = self._subscribers.odometry
        if octets is None:
            raise not_yet("the robot has not published its odometry yet")
        age = monotonic() - received
        if age > OLDEST:
            raise not_yet(f"the robot's last odometry came {age:.1f} s ago: where it is now is not known")
        if octets is not self._octets:
            self._octets, self._message = octets, deserialize_message(octets, Odometry)
        return self._message

    def age(self) -> float | None:
        """Return how many seconds ago the last message came; None before the first."""
        octets, received = self._subscribers.odometry
        return None if octets is None else monotonic() - received

    def plain(self) -> dict[str, Any]:
        """Return it as a plain nav_msgs/Odometry; raises the 503 also where a value in it is not finite."""
        return self._read(self.message())
