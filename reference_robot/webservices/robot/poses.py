"""Poses: checks of those that clients send, poses from a heading, and their transformation between frames.

Quaternions are in the order of ROS (x, y, z, w).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3

from reference_robot.webservices.representation.problems import Problem, clip, invalid_field

if TYPE_CHECKING:
    from reference_robot.names import Frames


_UNIT_TOLERANCE: Final = 1e-3  # contract, fine print
_Vector: TypeAlias = tuple[float, float, float]


def planar_pose(x: float, y: float, yaw: float) -> Pose:
    """Return the pose on the floor at x, y (m) with the heading yaw (rad)."""
    pose = Pose()
    pose.position.x, pose.position.y = x, y
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return pose


def require_known_frame(frame_id: str, frames: Frames, where: str) -> None:
    """Raise the Problem 422 for a frame that is neither the robot's map nor its odometry frame."""
    if frame_id not in {frames.map, frames.odom}:
        raise Problem(422, f"{where} must be {frames.map} or {frames.odom}: the robot knows no frame {clip(frame_id)}")


def require_pose(stamped: dict[str, Any], frames: Frames, where: str) -> None:
    """Raise the Problem 422 for the dict of a PoseStamped in an unknown frame or without a unit quaternion."""
    require_known_frame(stamped["header"]["frame_id"], frames, f"{where}.header.frame_id")
    orientation = stamped["pose"]["orientation"]
    if not abs(math.hypot(*orientation.values()) - 1) <= _UNIT_TOLERANCE:
        raise invalid_field(f"{where}.pose.orientation", orientation, f"must have length 1 within {_UNIT_TOLERANCE}")


def to_parent(transform: Transform, pose: Pose) -> Pose:
    """Return a pose, given in the child frame of a transform, in its parent frame."""
    x, y, z = _rotate(transform.rotation, (pose.position.x, pose.position.y, pose.position.z))
    away = transform.translation
    return Pose(
        position=Point(x=x + away.x, y=y + away.y, z=z + away.z),
        orientation=_product(transform.rotation, pose.orientation),
    )


def inverse(transform: Transform) -> Transform:
    """Return the inverse of a transform."""
    turn, away = transform.rotation, transform.translation
    back = Quaternion(x=-turn.x, y=-turn.y, z=-turn.z, w=turn.w)
    x, y, z = _rotate(back, (-away.x, -away.y, -away.z))
    return Transform(translation=Vector3(x=x, y=y, z=z), rotation=back)


def _rotate(turn: Quaternion, vector: _Vector) -> _Vector:
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
