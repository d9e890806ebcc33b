"""The latest odometry of the robot, deserialized and written as JSON, XML and text.

Messages are converted when a client requests them: an idle robot does nothing for its fifty messages a second. But if
clients requested the last two messages, the next one is converted on arrival, in the ROS thread. Otherwise a client
with a hundred requests a second would wait for the conversion in every second response.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from reference_robot.webservices.representation.messages import reader_of
from reference_robot.webservices.representation.problems import Problem, not_yet

if TYPE_CHECKING:
    from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode

OLDEST: Final = 1.0  # seconds; older odometry counts as missing (contract, REST)

T = TypeVar("T")
Writer = Callable[[dict[str, Any]], Any]  # of a plain nav_msgs/Odometry

_NO_WRITERS: Final[frozenset[Writer]] = frozenset()


class LatestOdometry:
    """The latest odometry message, with its age and its representations."""

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers
        self._read = reader_of(Odometry)
        self._count = 0  # messages so far
        self._converted = _Converted(0, b"", None, _NO_WRITERS)
        subscribers.on_odometry = self._convert_ahead

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
        serialized, received = self._subscribers.odometry
        return None if serialized is None else monotonic() - received

    def write_latest(self, writer: Callable[[dict[str, Any]], T]) -> T:
        """Return what a writer makes of the latest message (such as its JSON); a writer is called once per message.

        Raises:
            Problem: 503 as ``message``, and for a value that is not finite.
        """
        converted = self._latest()
        converted.writers.add(writer)
        if writer not in converted.written:
            converted.written[writer] = writer(self._read(converted.message))
        return cast("T", converted.written[writer])

    def _latest(self) -> _Converted:
        serialized, received = self._subscribers.odometry
        if serialized is None:
            raise not_yet("the robot has not published its odometry yet")
        age = monotonic() - received
        if age > OLDEST:
            raise not_yet(f"the robot's last odometry is {age:.1f} s old: the robot's pose is unknown")
        converted = self._converted
        if serialized is not converted.serialized:
            converted = self._converted = self._successor(serialized, converted)
        return converted

    def _convert_ahead(self, serialized: bytes) -> None:
        """Convert a message that has just arrived, if clients requested the last two; runs in the ROS thread.

        The event loop's thread may do the same conversion at the same time; then one of the two results is unused.
        """
        self._count += 1
        last = self._converted
        wanted = last.writers & last.earlier_writers
        if not wanted:
            return
        converted = self._successor(serialized, last)
        try:
            plain = self._read(converted.message)
            converted.written = {writer: writer(plain) for writer in wanted}
        except Problem:
            return  # a request for the message gets the problem
        self._converted = converted

    def _successor(self, serialized: bytes, last: _Converted) -> _Converted:
        earlier_writers = frozenset(last.writers) if self._count == last.number + 1 else _NO_WRITERS
        return _Converted(self._count, serialized, deserialize_message(serialized, Odometry), earlier_writers)


class _Converted:
    """An odometry message, its representations so far, and the writers used for it and for its predecessor."""

    def __init__(self, number: int, serialized: bytes, message: Any, earlier_writers: frozenset[Writer]) -> None:
        self.number = number
        self.serialized = serialized
        self.message = message
        self.written: dict[Writer, Any] = {}
        self.writers: set[Writer] = set()
        self.earlier_writers = earlier_writers
