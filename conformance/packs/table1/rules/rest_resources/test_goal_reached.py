"""A goal that is driven to: it ends there, is then no longer current, and its id can be used again."""

import time
from http import HTTPStatus
from typing import Any, Final

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_rules import judge_drive
from conformance.packs.table1.robot.drive_trace import Command
from conformance.packs.table1.robot.geometry import Pose, middle_of
from conformance.packs.table1.robot.goal import NEW, await_none, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.message_shapes import ODOMETRY
from conformance.packs.table1.robot.plan import ask, judge_start
from conformance.packs.table1.robot.robot import FARTHEST, POSE, Robot, Velocity
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("drive"), pytest.mark.needs("rest"), pytest.mark.motion]
# A robot that comes no nearer for so long does not drive, s; and how long one that does is waited for, by effort.
_NO_PROGRESS_S: Final = 5.0
# A robot may take a goal for reached a quarter of a metre before it (Nav2 does, unless told otherwise), m.
_REACHED_M: Final = 0.3
# Twice as far away is a goal, so that one that is given up on the way is not taken for reached, m.
_AWAY_M: Final = 0.6
_LOOKED_S: Final = 1.0
_WATCHDOG: Final = "safety/watchdog"
_LONGEST_S: Final = {"quick": 12.0}
_LONGEST_DEFAULT_S: Final = 30.0


@pytest.mark.requirement(
    "rest-resources/goal-put",
    "rest-resources/goal-drives",
    "rest-resources/goal-ended",
    "rest-resources/goal-id-again",
    "rest-resources/plan-start",
    "rest-resources/velocity-odometry",
    "rest-resources/pose-motion",
    _WATCHDOG,
)
@pytest.mark.usefixtures("_prepared")
def test_goal_until_it_is_reached(robot: Robot, judge: Judge, api: RestInterface) -> None:
    """A goal nearby is driven to and is then no longer current; its id can be used again."""
    here = robot.map_pose()
    if here is None:
        pytest.skip("the robot's pose cannot be read")
    there, other = choose_goals(robot, _AWAY_M, 2)
    before = _told_to_turn(robot, api.run.effort)
    # Displaced at once: it is not taken up again when the robot has arrived where it was sent last.
    put_goal(robot, goal_body(other, robot.statement.motion.frame, "displaced"))
    body, exchange = _put(robot, there)
    status = exchange.response.status
    if not judge.check("rest-resources/goal-put", status in NEW, exchange, "201 or 202 for a new goal"):
        return
    if not _drive_to(robot, judge, there, here, _LONGEST_S.get(api.run.effort.name, _LONGEST_DEFAULT_S)):
        return
    if before is not None:
        _judge_turning(robot, judge, before)
    # Away from where it was at first: a plan that always starts there is seen now.
    arrived = robot.map_pose()
    _, plan, asked = ask(robot, here)
    if plan is not None and arrived is not None:
        judge_start(robot, plan, arrived, asked, lambda: ask(robot, here)[1])
    again = put_goal(robot, body)
    status = again.response.status
    judge.check("rest-resources/goal-id-again", status in NEW, again, "201 or 202 for a goal whose id has ended before")
    await_none(robot, 0.1)
    robot.delete_goal()


def _told_to_turn(robot: Robot, effort: Effort) -> Command | None:
    """Command a velocity just before the goal; None where that would say nothing, or costs too much time."""
    limits = robot.limits
    turning = Velocity(angular_z=0.4 * limits.angular_rad_s)
    seen_from_rest = limits.tolerance_angular_rad_s + FARTHEST * limits.noise.angular_rad_s
    if (
        effort.name == "quick"
        or limits.hold_s is None
        or not robot.actuated(5)
        or turning.angular_z < 4 * seen_from_rest
    ):
        return None
    sent = time.monotonic()
    exchange = robot.put_velocity(turning)
    return Command(turning, sent, time.monotonic(), exchange) if exchange.response.ok else None


def _judge_turning(robot: Robot, judge: Judge, before: Command) -> None:
    """Judge that a velocity from before the goal, which has ended on the way, is not taken up again at the goal."""
    limits = robot.limits
    if limits.hold_s is None or time.monotonic() < before.answered + 1.5 * limits.hold_s + limits.settle_s:
        return
    drive = Drive(robot)
    drive.keep(limits.settle_s)
    turns, seen = drive.sees(before.velocity)
    # That it does not is no sign that a velocity ends by itself, for the goal has ended this one; and a robot that has
    # a goal of its own may turn for that.
    if turns and robot.goal()[0] is None:
        judge.check(
            _WATCHDOG,
            False,
            drive.trace.turns[-1].velocity_exchange,
            "a velocity from before the goal to have ended for good",
            found=f"velocity {seen}",
            cause="taken up after a goal",
        )


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


def _drive_to(robot: Robot, judge: Judge, there: Pose, start: Pose, longest_s: float) -> bool:
    """Watch until the goal has ended; judge that the robot drove and where it is."""
    drive = Drive(robot)
    began = progress = time.monotonic()
    nearest, yaw, here = start.distance(there), start.yaw, start
    while True:
        drive.look()
        goal, exchange = robot.goal()
        if goal is None and exchange.response.status != HTTPStatus.NOT_FOUND:
            # One answer that is neither the goal nor that there is none does not end it.
            goal, exchange = robot.goal()
        if drive.trace.odometry:
            here = robot.in_map(drive.trace.odometry[-1].pose)
        now = time.monotonic()
        if here.distance(there) < nearest - 0.02 or abs(here.yaw - yaw) > 0.05:
            progress, nearest, yaw = now, min(nearest, here.distance(there)), here.yaw
        if goal is None or now > progress + _NO_PROGRESS_S or now > began + longest_s:
            break
    judge_drive(judge, drive.whole, robot.limits, way=True)
    moved = 0.15 if start.distance(there) > 0.35 else 0.0
    if here.distance(there) >= _REACHED_M or start.distance(here) <= moved:
        # One sample may be out, or from before the end: those of a second say where the robot is.
        first = len(drive.trace.odometry)
        drive.keep(_LOOKED_S)
        here = middle_of([robot.in_map(one.pose) for one in drive.trace.odometry[first:]] or [here])
    left = here.distance(there)
    # Likewise where it was at first.
    way = max(one.distance(here) for one in (start, *(robot.in_map(one.pose) for one in drive.trace.odometry[:1])))
    ended = goal is None
    if not ended and left > _REACHED_M and now <= progress + _NO_PROGRESS_S:
        return False  # slow, but on its way: nothing to be said against it
    drove = judge.check(
        "rest-resources/goal-drives",
        left < _REACHED_M and way > moved,
        exchange,
        f"the robot at ({there.x:.2f}, {there.y:.2f}), where its goal was",
        found=f"it is {left:.2f} m away, having moved {way:.2f} m",
        cause="not driven" if way <= moved else "not reached",
    )
    judge.check(
        "rest-resources/goal-ended",
        ended and exchange.response.status == HTTPStatus.NOT_FOUND,
        exchange,
        "404 when the goal has been reached",
        found="" if ended else "the goal is still current",
    )
    return ended and drove
