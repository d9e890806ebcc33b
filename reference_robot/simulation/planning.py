"""Path planning for clients: the nav_msgs/GetPlan service of the paper and Nav2's ComputePathToPose action."""

import time
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import ComputePathToPose
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.action import ActionServer, CancelResponse
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Header

from reference_robot.names import RosNames
from reference_robot.simulation.messages import RESULT_TIMEOUT_S, Localisation, PoseError, pose_of, stamped_pose
from reference_robot.simulation.planner import PlanError, Planner, Pose


class Planning:
    """A ROS service and an action server that return paths without driving; the default start is the robot's pose."""

    def __init__(self, node: Node, names: RosNames, planner: Planner, localisation: Localisation) -> None:
        self._node = node
        self._frames = names.frames
        self._planner = planner
        self._localisation = localisation
        node.create_service(GetPlan, names.services.get_plan, self._get_plan)
        self._action = ActionServer(
            node,
            ComputePathToPose,
            names.actions.compute_path_to_pose,
            self._compute_path,
            cancel_callback=lambda _: CancelResponse.REJECT,  # a plan takes a millisecond
            result_timeout=RESULT_TIMEOUT_S,
        )

    def _get_plan(self, request: GetPlan.Request, response: GetPlan.Response) -> GetPlan.Response:
        """Fill the response with the path in the goal's frame, or with an empty path if there is none.

        A start without a frame_id stands for the robot's own pose.
        """
        try:
            start = self._start(request.start if request.start.header.frame_id else None)
            response.plan = self._plan(start, request.goal, request.tolerance)
        except (PlanError, PoseError) as error:
            self._node.get_logger().info(f"no plan: {error}", throttle_duration_sec=1.0)
            response.plan = Path(header=self._header(request.goal.header.frame_id))
        return response

    def _compute_path(self, handle: Any) -> ComputePathToPose.Result:
        began = time.monotonic()
        request, result = handle.request, ComputePathToPose.Result()
        try:
            start = self._start(request.start if request.use_start else None)
            result.path = self._plan(start, request.goal, 0.0)
        except PlanError as error:
            result.error_code, result.error_msg = int(error.failure), str(error)
        except PoseError as error:
            result.error_code, result.error_msg = ComputePathToPose.Result.TF_ERROR, str(error)
        result.planning_time = Duration(seconds=time.monotonic() - began).to_msg()
        if result.error_code == ComputePathToPose.Result.NONE:
            handle.succeed()
        else:
            handle.abort()
        return result

    def _start(self, stamped: PoseStamped | None) -> Pose:
        if stamped is not None:
            return pose_of(stamped, self._frames)
        return self._localisation.pose()

    def _plan(self, start: Pose, goal: PoseStamped, tolerance: float) -> Path:
        poses = self._planner.plan(start, pose_of(goal, self._frames), tolerance)
        header = self._header(goal.header.frame_id)
        path = Path(header=header, poses=[stamped_pose((x, y, yaw), header) for x, y, yaw in poses])
        if not tolerance or _same_point(path.poses[-1], goal):
            path.poses[-1].pose = goal.pose  # exactly; converting to yaw and back would round
        return path

    def _header(self, frame_id: str) -> Header:
        return Header(stamp=self._node.get_clock().now().to_msg(), frame_id=frame_id or self._frames.map)


def _same_point(one: PoseStamped, other: PoseStamped) -> bool:
    mine, theirs = one.pose.position, other.pose.position
    return bool(mine.x == theirs.x and mine.y == theirs.y)
