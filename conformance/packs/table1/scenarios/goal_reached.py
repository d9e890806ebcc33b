"""A goal that the robot reaches: it ends there, is then no longer active, and its id can be used again."""

from dataclasses import dataclass, replace
from http import HTTPStatus
from typing import Any, Final

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import Command
from conformance.packs.table1.robot.geometry import Pose, middle_of
from conformance.packs.table1.robot.goal import NEW, await_none, goal_body, put_goal
from conformance.packs.table1.robot.goal_trace import GoalReached
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.message_shapes import ODOMETRY
from conformance.packs.table1.robot.plan import ask, start_of
from conformance.packs.table1.robot.robot import FARTHEST, POSE, Robot
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort

# A robot that comes no nearer for so long does not drive, s; and how long one that does is waited for, by effort.
_NO_PROGRESS_S: Final = 5.0
_LONGEST_S: Final = {"quick": 12.0}
_LONGEST_DEFAULT_S: Final = 30.0
# A robot may take a goal for reached a quarter of a metre before it (Nav2 does, unless told otherwise), m.
_REACHED_M: Final = 0.3
# Twice as far away is a goal, so that one that is given up on the way is not taken for reached, m.
_AWAY_M: Final = 0.6
# So far the robot has to come from where it was, where the goal is farther than that, m.
_MOVED_M: Final = 0.15
_FAR_M: Final = 0.35
_LOOKED_S: Final = 1.0
# What counts as progress.
_NEARER_M: Final = 0.02
_TURNED_RAD: Final = 0.05


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.DRIVE)
def goal_reached(robot: Robot, effort: Effort, _prepared: None) -> GoalReached:
    """PUT a goal nearby, wait until the robot is there, and PUT the same goal again."""
    here = robot.map_pose()
    if here is None:
        raise NotPossibleError("the robot's pose cannot be read")
    there, other = choose_goals(robot, _AWAY_M, 2)
    before = _turning_before(robot, effort)
    # Displaced at once: it is not taken up again when the robot has arrived where it was sent last.
    put_goal(robot, goal_body(other, robot.statement.motion.frame, "displaced"))
    body, put = _put(robot, there)
    trace = GoalReached(put, there)
    if put.response.status not in NEW:
        return trace
    way = _Way(robot, Drive(robot), trace)
    try:
        way.drive_to(there, here, _LONGEST_S.get(effort.name, _LONGEST_DEFAULT_S))
        way.look_back(here, before, body)
    except Exception as error:
        raise PartialTraceError(way.recorded) from error
    return way.recorded


def _turning_before(robot: Robot, effort: Effort) -> Command | None:
    """Command a velocity just before the goal; return None if that shows nothing or takes too much time."""
    limits = robot.limits
    turning = robot.share_of_limits(0.0, 0.4)
    seen_from_rest = limits.tolerance_angular_rad_s + FARTHEST * limits.noise.angular_rad_s
    if effort.name == "quick" or limits.hold_s is None:
        return None
    if turning.angular_z < 4 * seen_from_rest:
        return None
    sent = robot.clock.now()
    exchange = robot.put_velocity(turning)
    return Command(turning, sent, robot.clock.now(), exchange) if exchange.response.ok else None


def _put(robot: Robot, there: Pose) -> tuple[dict[str, Any], Exchange]:
    """Put a goal: where the statement says that the frames differ, in the odometry's, if the robot takes that."""
    odometry, _ = robot.read(POSE, ODOMETRY)
    if odometry is not None and any(robot.statement.motion.odom_to_map):
        body = goal_body(robot.in_odometry(there), odometry["header"]["frame_id"], "reached")
        exchange = put_goal(robot, body)
        if exchange.response.status in NEW:
            return body, exchange
    body = goal_body(there, robot.statement.motion.frame, "reached")
    return body, put_goal(robot, body)


@dataclass
class _Way:
    """The robot's way to its goal."""

    robot: Robot
    drive: Drive
    trace: GoalReached

    @property
    def recorded(self) -> GoalReached:
        """Return the record so far."""
        return replace(self.trace, drive=self.drive.whole)

    def drive_to(self, there: Pose, start: Pose, longest_s: float) -> None:
        """Watch until the goal has ended, or the robot makes no progress."""
        robot, drive, clock = self.robot, self.drive, self.drive.clock
        began = progress = clock.now()
        nearest, yaw, here = start.distance(there), start.yaw, start
        while True:
            drive.look()
            goal, exchange = robot.goal()
            if goal is None and exchange.response.status != HTTPStatus.NOT_FOUND:
                # One answer that is neither the goal nor that there is none does not end it.
                goal, exchange = robot.goal()
            if drive.trace.odometry:
                here = robot.in_map(drive.trace.odometry[-1].pose)
            now = clock.now()
            if here.distance(there) < nearest - _NEARER_M or abs(here.yaw - yaw) > _TURNED_RAD:
                progress, nearest, yaw = now, min(nearest, here.distance(there)), here.yaw
            if goal is None or now > progress + _NO_PROGRESS_S or now > began + longest_s:
                break
        driven = drive.whole
        moved = _MOVED_M if start.distance(there) > _FAR_M else 0.0
        if here.distance(there) >= _REACHED_M or start.distance(here) <= moved:
            # One sample may be wrong, or from before the end: those of a second say where the robot is.
            first = len(drive.trace.odometry)
            drive.keep(_LOOKED_S)
            here = middle_of([robot.in_map(one.pose) for one in drive.trace.odometry[first:]] or [here])
        left = here.distance(there)
        # Likewise where it was at first.
        begins = (start, *(robot.in_map(one.pose) for one in driven.odometry[:1]))
        self.trace = replace(
            self.trace,
            here=here,
            way_m=max(one.distance(here) for one in begins),
            has_to_m=moved,
            left_m=left,
            reached_m=_REACHED_M,
            read=exchange,
            ended=goal is None,
            undecided=goal is not None and left > _REACHED_M and now <= progress + _NO_PROGRESS_S,
        )

    def look_back(self, start: Pose, before: Command | None, body: dict[str, Any]) -> None:
        """Watch, after a goal was reached, for the velocity from before it; request a plan back; PUT the goal again."""
        trace, robot = self.trace, self.robot
        if trace.undecided or not trace.ended or trace.left_m >= trace.reached_m or trace.way_m <= trace.has_to_m:
            return
        if before is not None:
            self._watch_for(before)
        # Away from where it was at first: a plan that always starts there is seen now.
        arrived = robot.map_pose()
        _, plan, exchange = ask(robot, start)
        if plan is not None and arrived is not None:
            found = start_of(robot, plan, arrived, exchange, lambda: ask(robot, start)[1])
            self.trace = replace(self.trace, start=found)
        self.trace = replace(self.trace, again=put_goal(robot, body))
        await_none(robot, 0.1)
        robot.delete_goal()

    def _watch_for(self, before: Command) -> None:
        """Watch at the goal whether the robot resumes a velocity from before the goal, which has ended on the way."""
        limits, drive = self.robot.limits, Drive(self.robot)
        if limits.hold_s is None or drive.clock.now() < before.answered + 1.5 * limits.hold_s + limits.settle_s:
            return
        drive.keep(limits.settle_s)
        turns, seen = drive.sees(before.velocity)
        # That it does not is no sign that a velocity ends by itself, for the goal has ended this one; and a robot that
        # has a goal of its own may turn for that.
        if turns and self.robot.goal()[0] is None:
            expected = "a velocity from before the goal that has ended for good"
            drive.saw("safety/watchdog", expected, f"the velocity ({seen})", "taken up after a goal", holds=False)
        self.trace = replace(self.trace, turned=drive.trace)
