"""Checks of poses that clients send (frame, unit quaternion), and poses from a heading."""

import math
from typing import Any, Final

from geometry_msgs.msg import Pose

from reference_robot.names import Frames
from reference_robot.webservices.representation.checking import refused, shown
from reference_robot.webservices.representation.problems import Problem

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
