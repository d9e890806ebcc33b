"""The latest odometry of the robot, deserialized and written as JSON, XML and text.

Messages are converted when a client requests them: an idle robot does nothing for its fifty messages a second. But if
clients requested the last two messages, the next one is converted on arrival, in the ROS thread. Otherwise a client
with a hundred requests a second would wait for the conversion in every second response.

Poses: checks of those that clients send, poses from a heading, and their transformation between frames.

Quaternions are in the order of ROS (x, y, z, w).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING, Any, Final, TypeAlias, TypeVar, cast

from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from reference_robot.webservices.representation.messages import reader_of
from reference_robot.webservices.representation.problems import Problem, not_yet, refused, shown

if TYPE_CHECKING:
    from reference_robot.names import Frames
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

    def written(self, writer: Callable[[dict[str, Any]], T]) -> T:
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


_UNIT_TOLERANCE: Final = 1e-3  # contract, fine print


def planar_pose(x: float, y: float, yaw: float) -> Pose:
    """Return the pose on the floor at x, y (m) with the heading yaw (rad)."""
    pose = Pose()
    pose.position.x, pose.position.y = x, y
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return pose


def require_known_frame(frame_id: str, frames: Frames, where: str) -> None:
    """Raise the Problem 422 for a frame that is neither the robot's map nor its odometry frame."""
    if frame_id not in {frames.map, frames.odom}:
        raise Problem(422, f"{where} must be {frames.map} or {frames.odom}: the robot knows no frame {shown(frame_id)}")


def require_pose(stamped: dict[str, Any], frames: Frames, where: str) -> None:
    """Raise the Problem 422 for the dict of a PoseStamped in an unknown frame or without a unit quaternion."""
    require_known_frame(stamped["header"]["frame_id"], frames, f"{where}.header.frame_id")
    orientation = stamped["pose"]["orientation"]
    if not abs(math.hypot(*orientation.values()) - 1) <= _UNIT_TOLERANCE:
        raise refused(f"{where}.pose.orientation", orientation, f"must have length 1 within {_UNIT_TOLERANCE}")


_Vector: TypeAlias = tuple[float, float, float]


def moved(transform: Transform, pose: Pose) -> Pose:
    """Return a pose, given in the child frame of a transform, in its parent frame."""
    x, y, z = _turned(transform.rotation, (pose.position.x, pose.position.y, pose.position.z))
    away = transform.translation
    return Pose(
        position=Point(x=x + away.x, y=y + away.y, z=z + away.z),
        orientation=_product(transform.rotation, pose.orientation),
    )


def inverse(transform: Transform) -> Transform:
    """Return the inverse of a transform."""
    turn, away = transform.rotation, transform.translation
    back = Quaternion(x=-turn.x, y=-turn.y, z=-turn.z, w=turn.w)
    x, y, z = _turned(back, (-away.x, -away.y, -away.z))
    return Transform(translation=Vector3(x=x, y=y, z=z), rotation=back)


def _turned(turn: Quaternion, vector: _Vector) -> _Vector:
    """Return a vector rotated by a unit quaternion: v + 2wt + 2(u x t) with t = u x v; exact for the identity."""
    axis = (turn.x, turn.y, turn.z)
    once = _cross(axis, vector)
    twice = _cross(axis, once)
    x, y, z = (part + 2 * (turn.w * one + two) for part, one, two in zip(vector, once, twice, strict=True))
    return x, y, z


def _cross(a: _Vector, b: _Vector) -> _Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    return Quaternion(
        x=a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        y=a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        z=a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        w=a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    )
