"""Path planning by the robot's GetPlan service or Nav2's ComputePathToPose action, and the poses of plans and goals.

Quaternions are in the order of ROS (x, y, z, w).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeAlias

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, Vector3
from nav2_msgs.action import ComputePathToPose
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan

from reference_robot.names import Frames
from reference_robot.webservices.nodes.calls import ManagedNode, RosCalls
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.messages import reader_of
from reference_robot.webservices.representation.problems import Problem, clip, invalid_field, not_yet
from reference_robot.webservices.robot.odometry import LatestOdometry

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


_Move: TypeAlias = Callable[[Pose], Pose]

_LARGEST_TOLERANCE: Final = 3.4e38  # nav_msgs/GetPlan carries it as a float32


@dataclass(frozen=True)
class PlanQuery:
    """A request for a plan: goal and start in ``frame_id``, in metres and radians.

    Without any start value the planner uses the robot's pose; if some are given, the missing ones are the robot's own.
    """

    x: float
    y: float
    yaw: float = 0.0
    frame_id: str = "map"
    tolerance: float = 0.1
    start_x: float | None = None
    start_y: float | None = None
    start_yaw: float | None = None


class Planner:
    """A client of the robot's planner, for poses in one of its ``frames``."""

    def __init__(
        self,
        subscribers: RobotSubscribersNode,
        calls: RosCalls,
        planner: ManagedNode,
        odometry: LatestOdometry,
        frames: Frames,
    ) -> None:
        self._subscribers = subscribers
        self._calls = calls
        self._planner = planner
        self._odometry = odometry
        self._frames = frames
        self._read = reader_of(Path)

    async def plan(self, query: PlanQuery) -> dict[str, Any]:
        """Return a path as the dict of a nav_msgs/GetPlan response, ``{"plan": Path}``, with at least one pose.

        Raises:
            Problem: 422 for an unknown frame, a negative tolerance or a goal that no plan reaches; 503 without a
                planner, or without odometry if a part of the start is the robot's own pose.
        """
        require_known_frame(query.frame_id, self._frames, "frame_id")
        if not 0 <= query.tolerance <= _LARGEST_TOLERANCE:
            raise Problem(422, f"tolerance must be a length of 0 m or more, not {query.tolerance}")
        frame, into, back = self._planning_frame(query.frame_id)
        start = self._start(query)
        stamped_start = None if start is None else self._stamp(into(start), frame)
        goal = self._stamp(into(planar_pose(query.x, query.y, query.yaw)), frame)
        if self._subscribers.plan_service_is_served():
            # A start without a frame_id means the robot's own pose (move_base's make_plan).
            request = GetPlan.Request(start=stamped_start or PoseStamped(), goal=goal, tolerance=query.tolerance)
            reply = await self._calls.result(lambda: self._subscribers.ask_plan_service(request), "the plan service")
            path = reply.plan
        elif self._subscribers.plan_action_is_served():
            path = await self._by_action(stamped_start, goal)
        else:
            raise not_yet("the robot has no planner")
        if not path.poses:
            raise Problem(422, f"no plan leads to x = {query.x}, y = {query.y} in frame {query.frame_id}")
        if path.header.frame_id == frame != query.frame_id:
            _move(path, back, query.frame_id)
        plain = self._read(path)
        if plain["header"]["frame_id"] != query.frame_id:
            raise Problem(422, f"the robot plans in frame {plain['header']['frame_id']}, not {query.frame_id}")
        return {"plan": plain}

    def _planning_frame(self, requested: str) -> tuple[str, _Move, _Move]:
        """Return the frame to plan in, and the functions that transform a pose into it and back.

        Planners work in the map frame. If the transform from the map to the requested frame is unknown, the requested
        frame is used.
        """
        transform = self._subscribers.map_transform.latest
        if transform is None or requested == self._frames.map:
            return requested, _as_it_is, _as_it_is
        return self._frames.map, partial(to_parent, transform), partial(to_parent, inverse(transform))

    async def _by_action(self, start: PoseStamped | None, goal: PoseStamped) -> Path:
        request = ComputePathToPose.Goal(start=start or PoseStamped(), goal=goal, use_start=start is not None)
        handle = await self._calls.result(lambda: self._subscribers.ask_plan_action(request), "the planner")
        if not handle.accepted:
            await self._planner.require_active()
            return Path()
        reply = await self._calls.result(handle.get_result_async, "the planner")
        return reply.result.path if reply.status == GoalStatus.STATUS_SUCCEEDED else Path()

    def _start(self, query: PlanQuery) -> Pose | None:
        """Return the start pose in the requested frame; None if the query has no start."""
        if query.start_x is not None and query.start_y is not None:
            return planar_pose(query.start_x, query.start_y, query.start_yaw or 0.0)
        if query.start_x is None and query.start_y is None and query.start_yaw is None:
            return None
        own = self._own_pose(query.frame_id)
        x = own.position.x if query.start_x is None else query.start_x
        y = own.position.y if query.start_y is None else query.start_y
        pose = planar_pose(x, y, query.start_yaw or 0.0)
        if query.start_yaw is None:
            pose.orientation = own.orientation
        return pose

    def _own_pose(self, frame_id: str) -> Pose:
        """Return the robot's pose in a frame; without a known transform the odometry frame counts as the map."""
        pose = self._odometry.message().pose.pose
        transform = self._subscribers.map_transform.latest
        return pose if transform is None or frame_id != self._frames.map else to_parent(transform, pose)

    def _stamp(self, pose: Pose, frame_id: str) -> PoseStamped:
        stamped = PoseStamped(pose=pose)
        stamped.header.frame_id = frame_id
        stamped.header.stamp = self._subscribers.node.get_clock().now().to_msg()
        return stamped


def _as_it_is(pose: Pose) -> Pose:
    return pose


def _move(path: Path, into: _Move, frame_id: str) -> None:
    path.header.frame_id = frame_id
    for stamped in path.poses:
        stamped.header.frame_id = frame_id
        stamped.pose = into(stamped.pose)
