"""Transformation of poses between coordinate frames; quaternions in ROS's order (x, y, z, w)."""

from typing import TypeAlias

from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3

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
