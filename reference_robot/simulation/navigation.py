"""Navigation: an action server for Nav2's NavigateToPose that drives the robot through the topic cmd_vel.

The server refuses a goal to which no path leads. A newer goal displaces the active one, which ends as ABORTED, as in
Nav2. Two latched topics publish what action clients cannot see: the active goal, whichever client sent it, and the
reason for the last refusal.

It is driven along its path by pure pursuit. A robot that cannot turn on the spot turns as a car does in a narrow
street: to and fro on two arcs.
"""

import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Twist, TwistStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Header, String

from reference_robot.kinematics import Kinematics
from reference_robot.names import RosNames
from reference_robot.simulation.messages import (
    LATCHED,
    RESULT_TIMEOUT_S,
    Localisation,
    PoseError,
    plain,
    pose_of,
    stamped_pose,
)
from reference_robot.simulation.office import Floats
from reference_robot.simulation.planner import PlanError, Planner, Pose
from reference_robot.simulation.realism import within, wrap

_TO_AND_FRO: Final = 0.03  # m to either side of where a robot turns that cannot do so on the spot
_LOOKAHEAD: Final = 0.4  # m
EXACT: Final = (0.03, 0.02)  # m, rad
_SLOWEST_TURN: Final = 0.3  # rad/s of a robot that turns to and fro
_DRIFT: Final = 0.1  # m from the goal beyond which a robot that turns on the spot drives again
_TURN_ON_SPOT: Final = 0.6  # rad off the course beyond which the robot stops and turns
_SEARCH_AHEAD: Final = 8  # path poses among which the nearest is searched


@dataclass(frozen=True)
class Command:
    """A velocity to drive with (m/s, rad/s), the remaining path length (m), and whether the goal is reached."""

    linear: float
    angular: float
    remaining: float
    arrived: bool


class Pursuit:
    """A controller that follows a planned path, (k, 3) poses, to its end within tolerances (m, rad)."""

    def __init__(
        self, path: Floats, tolerances: tuple[float, float] = EXACT, kinematics: Kinematics | None = None
    ) -> None:
        self._path = path
        self._kinematics = kinematics or Kinematics()
        self._turned_at: tuple[float, float] | None = None
        self._sense = 1.0
        self._near, self._straight = tolerances
        pieces = np.hypot(*np.diff(path[:, :2], axis=0).T)
        self._left = np.append(np.cumsum(pieces[::-1])[::-1], 0.0)
        self._nearest = 0
        self._turning = False

    def command(self, x: float, y: float, yaw: float) -> Command:
        """Return the next velocity for a robot at the given pose."""
        goal_x, goal_y, goal_yaw = self._path[-1]
        off = math.dist((x, y), (goal_x, goal_y))
        if off < self._near:
            self._turning = True
        elif off > _DRIFT:
            self._turning = False
        if self._turning:
            error = wrap(goal_yaw - yaw)
            self._turned_at = float(goal_x), float(goal_y)
            arrived = abs(error) < self._straight
            turn = 3.0 * error + math.copysign(0.1, error)
            return self._turn(0.0 if arrived else turn, off, (x, y, yaw), arrived=arrived)
        target_x, target_y, remaining = self._target(x, y)
        course = wrap(math.atan2(target_y - y, target_x - x) - yaw)
        if abs(course) > _TURN_ON_SPOT:
            return self._turn(3.0 * course, remaining, (x, y, yaw))
        self._turned_at = None
        # Slower near the goal, so that the robot stops there, and off the course, so that it cuts no corners.
        linear = min(self._kinematics.cruise, 2.5 * off + 0.05) * math.cos(course) ** 4
        return Command(linear, within(3.0 * course, self._kinematics.turn), remaining, arrived=False)

    def _turn(
        self, angular: float, remaining: float, pose: tuple[float, float, float], *, arrived: bool = False
    ) -> Command:
        """Return the velocity that turns the robot where it is."""
        turn = within(angular, self._kinematics.turn)
        if not self._kinematics.min_radius or arrived:
            return Command(0.0, turn, remaining, arrived)
        x, y, yaw = pose
        self._turned_at = self._turned_at or (x, y)
        ahead = (x - self._turned_at[0]) * math.cos(yaw) + (y - self._turned_at[1]) * math.sin(yaw)
        if abs(ahead) > _TO_AND_FRO:
            self._sense = -math.copysign(1.0, ahead)
        speed = 1.02 * self._kinematics.min_radius * max(abs(turn), _SLOWEST_TURN)
        return Command(self._sense * speed, math.copysign(max(abs(turn), _SLOWEST_TURN), turn), remaining, arrived)

    def _target(self, x: float, y: float) -> tuple[float, float, float]:
        """Return x and y of the path pose that lies the lookahead distance ahead, and the remaining path length."""
        window = self._path[self._nearest : self._nearest + _SEARCH_AHEAD, :2]
        distances = np.hypot(*(window - (x, y)).T)
        self._nearest += int(distances.argmin())
        ahead = self._left <= self._left[self._nearest] - _LOOKAHEAD
        target = self._path[int(ahead.argmax()) if ahead.any() else -1]
        return float(target[0]), float(target[1]), float(self._left[self._nearest] + distances.min())


PATIENCE_S: Final = 20.0  # without getting 0.05 m nearer, in simulated time
_NEARER_M: Final = 0.05
# A control step follows each odometry message, 50 times a second. A longer interval means that the processes were
# delayed, which must not count as a lack of progress.
_STEP_S: Final = 0.1
_FEEDBACK_PERIOD_S: Final = 0.2
_FAILED_TO_MAKE_PROGRESS: Final = 105  # code of nav2_msgs/FollowPath, which Nav2's navigator passes on


class Progress:
    """The remaining distance to a goal, followed over time.

    Args:
        now: When the goal was accepted, by any clock in seconds.
        time_scale: Simulated seconds per second of that clock.
    """

    def __init__(self, now: float, time_scale: float) -> None:
        self._time_scale = time_scale
        self._stepped = now
        self._nearest = math.inf
        self._waited_s = 0.0

    def is_lacking(self, remaining: float, now: float) -> bool:
        """Record the remaining distance in metres; return whether it has not decreased for 20 simulated seconds."""
        self._waited_s += min(now - self._stepped, _STEP_S) * self._time_scale
        self._stepped = now
        if remaining < self._nearest - _NEARER_M:
            self._nearest, self._waited_s = remaining, 0.0
        return self._waited_s > PATIENCE_S


class _DeferringActionServer(ActionServer):
    """An action server that starts a goal's task only when the goal's result is available.

    rclpy polls a task that awaits something until it is done, which keeps a processor core busy.
    """

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        """Do nothing when a goal starts executing; the base class would start a task here."""

    def finish(self, goal_handle: Any, result: Any) -> None:
        """Send the result of a goal that has reached a final state."""
        super().notify_execute(goal_handle, lambda _: result)


@dataclass
class _Drive:
    """The goal that the robot is driving to: its handle, its path, and the progress made."""

    handle: Any
    pursuit: Pursuit
    began: float
    progress: Progress
    reported: float = 0.0
    canceling: bool = False


class Navigation:
    """The NavigateToPose action server; each odometry message triggers one control step."""

    def __init__(
        self,
        node: Node,
        names: RosNames,
        planner: Planner,
        localisation: Localisation,
        time_scale: float = 1.0,
        tolerances: tuple[float, float] = EXACT,
        kinematics: Kinematics | None = None,
    ) -> None:
        self._node = node
        self._names = names
        self._planner = planner
        self._localisation = localisation
        self._time_scale = time_scale
        self._tolerances = tolerances
        self._kinematics = kinematics or Kinematics()
        self._drive: _Drive | None = None
        self._path: Any = None  # of the last accepted goal, until it begins
        self._stamped = names.velocity.message == "TwistStamped"
        velocity = TwistStamped if self._stamped else Twist
        self._velocities = node.create_publisher(velocity, names.topics.cmd_vel, 1)
        self._current_goals = node.create_publisher(String, names.topics.current_goal, LATCHED)
        self._rejections = node.create_publisher(String, names.topics.last_rejection, LATCHED)
        self._publish_current_goal()
        localisation.on_update = self._step
        self._action = _DeferringActionServer(
            node,
            NavigateToPose,
            names.actions.navigate_to_pose,
            lambda _: NavigateToPose.Result(),
            goal_callback=self._judge,
            handle_accepted_callback=self._begin,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            result_timeout=RESULT_TIMEOUT_S,
        )

    def _judge(self, goal: NavigateToPose.Goal) -> GoalResponse:
        try:
            target = pose_of(goal.pose, self._names.frames)
            self._path = self._planner.plan(self._localisation.pose(), target)
        except (PlanError, PoseError) as error:
            self._node.get_logger().info(f"refused a goal: {error}", throttle_duration_sec=1.0)
            # Published before the refusal is sent, so that the client can look up the reason.
            rejection = {"pose": plain(goal.pose), "reason": str(error)}
            self._rejections.publish(String(data=json.dumps(rejection)))
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _begin(self, handle: Any) -> None:
        displaced, path = self._drive, self._path
        now = time.monotonic()
        self._drive = _Drive(
            handle, Pursuit(path, self._tolerances, self._kinematics), now, Progress(now, self._time_scale)
        )
        if displaced is not None:
            displaced.handle.abort()
            self._action.finish(displaced.handle, NavigateToPose.Result(error_msg="preempted by a newer goal"))
        handle.execute()
        self._publish_current_goal()

    def _step(self) -> None:
        """Execute one control step for the active goal; runs after each odometry message."""
        drive = self._drive
        if drive is None:
            return
        if drive.handle.is_cancel_requested:
            if not drive.canceling:
                drive.canceling = True
                self._publish_current_goal()
            self._end(drive, drive.handle.canceled)
            return
        pose = self._localisation.pose()
        command = drive.pursuit.command(*pose)
        if command.arrived:
            self._end(drive, drive.handle.succeed)
            return
        now = time.monotonic()
        if drive.progress.is_lacking(command.remaining, now):
            self._end(drive, drive.handle.abort, _FAILED_TO_MAKE_PROGRESS, f"no progress in {PATIENCE_S:g} s")
            return
        self._command(command.linear, command.angular)
        if now - drive.reported >= _FEEDBACK_PERIOD_S:
            drive.reported = now
            self._publish_feedback(drive, pose, command, now)

    def _end(self, drive: _Drive, transition: Callable[[], None], error: int = 0, message: str = "") -> None:
        self._drive = None
        self._command(0.0, 0.0)
        transition()
        self._action.finish(drive.handle, NavigateToPose.Result(error_code=error, error_msg=message))
        self._publish_current_goal()

    def _command(self, linear: float, angular: float) -> None:
        twist = Twist()
        twist.linear.x, twist.angular.z = linear, angular
        if self._stamped:
            self._velocities.publish(TwistStamped(header=self._header(self._names.frames.base), twist=twist))
        else:
            self._velocities.publish(twist)

    def _publish_feedback(self, drive: _Drive, pose: Pose, command: Command, now: float) -> None:
        feedback = NavigateToPose.Feedback(
            current_pose=stamped_pose(pose, self._header(self._names.frames.map)),
            navigation_time=Duration(seconds=now - drive.began).to_msg(),
            estimated_time_remaining=Duration(
                seconds=command.remaining / (self._kinematics.cruise * self._time_scale)
            ).to_msg(),
            distance_remaining=command.remaining,
        )
        drive.handle.publish_feedback(feedback)

    def _publish_current_goal(self) -> None:
        drive, text = self._drive, ""
        if drive is not None:
            status = GoalStatus.STATUS_CANCELING if drive.canceling else GoalStatus.STATUS_EXECUTING
            goal_id = bytes(drive.handle.goal_id.uuid).hex()
            text = json.dumps({"goal_id": goal_id, "status": status, "pose": plain(drive.handle.request.pose)})
        self._current_goals.publish(String(data=text))

    def _header(self, frame_id: str) -> Header:
        return Header(stamp=self._node.get_clock().now().to_msg(), frame_id=frame_id)
