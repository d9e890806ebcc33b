"""The latest odometry of the robot, deserialized and written as JSON, XML and text.

Messages are converted when a client requests them: an idle robot does nothing for its fifty messages a second. But if
clients requested the last two messages, the next one is converted on arrival, in the ROS thread. Otherwise a client
with a hundred requests a second would wait for the conversion in every second response.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any, Final, TypeVar, cast

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.messages import reader_of
from reference_robot.webservices.representation.problems import Problem, not_yet

OLDEST: Final = 1.0  # seconds; older odometry counts as missing (contract, REST)

T = TypeVar("T")
Writer = Callable[[dict[str, Any]], Any]  # of a plain nav_msgs/Odometry

_NOBODY: Final[frozenset[Writer]] = frozenset()


class LatestOdometry:
    """The latest odometry message, with its age and its representations."""

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers
        self._read = reader_of(Odometry)
        self._came = 0  # messages so far
        self._told = _Told(0, b"", None, _NOBODY)
        subscribers.on_odometry = self._foresee

    def message(self) -> Odometry:
        """Return the latest odometry message.

        The message's age is measured from its arrival by this machine's clock, because the robot's clock may differ.

        Raises:
            Problem: 503 before the first message, and if the latest is over a second old, because the robot stopped
                publishing or the ROS thread of this process hangs.
        """
        return self._latest().message

    def age(self) -> float | None:
        """Return how many seconds ago the latest message arrived; None before the first."""
        octets, received = self._subscribers.odometry
        return None if octets is None else monotonic() - received

    def written(self, writer: Callable[[dict[str, Any]], T]) -> T:
        """Return the result of a writer for the latest message; each writer is called at most once per message.

        Raises:
            Problem: 503 as ``message``, and for a value that is not finite.
        """
        told = self._latest()
        told.asked.add(writer)
        if writer not in told.written:
            told.written[writer] = writer(self._read(told.message))
        return cast("T", told.written[writer])

    def _latest(self) -> _Told:
        octets, received = self._subscribers.odometry
        if octets is None:
            raise not_yet("the robot has not published its odometry yet")
        age = monotonic() - received
        if age > OLDEST:
            raise not_yet(f"the robot's last odometry is {age:.1f} s old: the robot's pose is unknown")
        told = self._told
        if octets is not told.octets:
            told = self._told = self._successor(octets, told)
        return told

    def _foresee(self, octets: bytes) -> None:
        """Convert a message that has just arrived, if clients requested the last two; runs in the ROS thread.

        The event loop's thread may do the same conversion at the same time; then one of the two results is unused.
        """
        self._came += 1
        last = self._told
        wanted = last.asked & last.asked_before
        if not wanted:
            return
        told = self._successor(octets, last)
        try:
            plain = self._read(told.message)
            told.written = {writer: writer(plain) for writer in wanted}
        except Problem:
            return  # a request for the message gets the problem
        self._told = told

    def _successor(self, octets: bytes, last: _Told) -> _Told:
        asked_before = frozenset(last.asked) if self._came == last.number + 1 else _NOBODY
        return _Told(self._came, octets, deserialize_message(octets, Odometry), asked_before)


class _Told:
    """An odometry message, its representations so far, and the writers used for it and for its predecessor."""

    def __init__(self, number: int, octets: bytes, message: Any, asked_before: frozenset[Writer]) -> None:
        self.number = number
        self.octets = octets
        self.message = message
        self.written: dict[Writer, Any] = {}
        self.asked: set[Writer] = set()
        self.asked_before = asked_before
