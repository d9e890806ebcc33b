"""The odometry received last: where the robot is and how fast it moves, as it measures itself.

What a message says, and what is written of it, is worked out when somebody asks: an idle robot does nothing for its
fifty messages a second. But where message after message is asked for, the next one is worked out when it comes, in
ROS's thread. Otherwise one answer in two of a client that asks a hundred times a second would take that time, and the
other would not.
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

OLDEST: Final = 1.0  # seconds; what is older is no odometry (contract, REST)

T = TypeVar("T")
Writer = Callable[[dict[str, Any]], Any]  # of a plain nav_msgs/Odometry

_NOBODY: Final[frozenset[Writer]] = frozenset()


class LatestOdometry:
    """Tells what the robot measures."""

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers
        self._read = reader_of(Odometry)
        self._came = 0  # messages
        self._told = _Told(0, b"", None, _NOBODY)
        subscribers.on_odometry = self._foresee

    def message(self) -> Odometry:
        """Return the message received last.

        Its age is counted from its arrival, by this machine's clock: a robot's own clock may be another one.

        Raises:
            Problem: 503 before the first, and while the last is older than a second, be it that the robot fell silent
                or that ROS's thread in this process hangs.
        """
        return self._latest().message

    def age(self) -> float | None:
        """Return how many seconds ago the last message came; None before the first."""
        octets, received = self._subscribers.odometry
        return None if octets is None else monotonic() - received

    def written(self, writer: Callable[[dict[str, Any]], T]) -> T:
        """Return what a writer makes of the message received last: made once for each, however often it is asked for.

        Raises:
            Problem: As ``message``; the 503 also where a value in it is not finite.
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
            raise not_yet(f"the robot's last odometry came {age:.1f} s ago: where it is now is not known")
        told = self._told
        if octets is not told.octets:
            told = self._told = self._successor(octets, told)
        return told

    def _foresee(self, octets: bytes) -> None:
        """Work a message out that has just come, for those who asked for the last two; in ROS's thread.

        Should the event loop's thread do the same meanwhile, one of the two was in vain.
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
            return  # whoever asks is told
        self._told = told

    def _successor(self, octets: bytes, last: _Told) -> _Told:
        asked_before = frozenset(last.asked) if self._came == last.number + 1 else _NOBODY
        return _Told(self._came, octets, deserialize_message(octets, Odometry), asked_before)


class _Told:
    """What one message says, what has been written of it, who asked for that, and who asked for the one before it."""

    def __init__(self, number: int, octets: bytes, message: Any, asked_before: frozenset[Writer]) -> None:
        self.number = number
        self.octets = octets
        self.message = message
        self.written: dict[Writer, Any] = {}
        self.asked: set[Writer] = set()
        self.asked_before = asked_before
