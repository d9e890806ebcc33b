"""Plane geometry: headings, frames, distances."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple


class Pose(NamedTuple):
    """A position and heading in the plane: x and y in metres, yaw in radians."""

    x: float
    y: float
    yaw: float

    def distance(self, other: Pose) -> float:
        """Return the distance to another pose, m."""
        return math.hypot(other.x - self.x, other.y - self.y)

    def ahead(self, distance: float, turn: float = 0.0) -> Pose:
        """Return the pose ``distance`` m away in the direction of the heading plus ``turn`` (rad), facing that way."""
        yaw = wrapped(self.yaw + turn)
        return Pose(self.x + distance * math.cos(yaw), self.y + distance * math.sin(yaw), yaw)

    def seen_from(self, frame: Pose) -> Pose:
        """Transform this pose, given relative to ``frame``, into the frame in which ``frame`` itself is given."""
        cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
        return Pose(
            frame.x + cos * self.x - sin * self.y, frame.y + sin * self.x + cos * self.y, wrapped(self.yaw + frame.yaw)
        )

    def seen_in(self, frame: Pose) -> Pose:
        """Transform this pose into coordinates relative to ``frame``; the inverse of seen_from()."""
        cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
        x, y = self.x - frame.x, self.y - frame.y
        return Pose(cos * x + sin * y, cos * y - sin * x, wrapped(self.yaw - frame.yaw))


def middle_of(poses: Sequence[Pose]) -> Pose:
    """Return the medians of x, y and heading, which a few wrong readings do not change."""
    yaw = poses[-1].yaw
    turned = median(wrapped(pose.yaw - yaw) for pose in poses)
    return Pose(median(pose.x for pose in poses), median(pose.y for pose in poses), wrapped(yaw + turned))


def wrapped(angle: float) -> float:
    """Return an angle wrapped to -pi to pi, rad."""
    return math.remainder(angle, math.tau)


def length_of(quaternion: Mapping[str, Any]) -> float:
    """Return the length of a quaternion {x, y, z, w}."""
    return math.hypot(*(float(quaternion[axis]) for axis in "xyzw"))


def yaw_of(quaternion: Mapping[str, Any]) -> float:
    """Return the heading of a quaternion of any length, rad, counterclockwise from x (REP 103)."""
    x, y, z, w = (float(quaternion[axis]) for axis in "xyzw")
    return math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def quaternion_of(yaw: float, length: float = 1.0) -> dict[str, float]:
    """Return the quaternion of a heading (rad), scaled to a length."""
    return {"x": 0.0, "y": 0.0, "z": length * math.sin(yaw / 2), "w": length * math.cos(yaw / 2)}


def pose_of(pose: Mapping[str, Any]) -> Pose:
    """Return the plane pose of a geometry_msgs/Pose in JSON."""
    position = pose["position"]
    return Pose(float(position["x"]), float(position["y"]), yaw_of(pose["orientation"]))
