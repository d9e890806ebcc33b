"""The life of a goal: put, read, repeated, contradicted, displaced, cancelled, reached, and put again."""

import time
from collections.abc import Sequence
from typing import Any, Final

import pytest

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_rules import judge_drive
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import (
    CANCELLED,
    NEW,
    RATHER_XML,
    REPEATED,
    arrived,
    await_goal,
    await_none,
    difference,
    goal_body,
    put_goal,
    status_fault,
)
from conformance.packs.table1.robot.goals import choose_goals, meanwhile
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity
from conformance.packs.table1.robot.standstill import Standstill
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("standstill"), pytest.mark.needs("rest"), pytest.mark.motion]
_ID: Final = "goal 1/\u00e9\u4e2d?&\"'<>\\ of the suite"
_CANCELING: Final = 3
# Where a look takes longer, a velocity may have ended before it is read, s.
_LOOK_S: Final = 0.1
# For so long after a cancelled goal the robot has to stay where it is: longer than second thoughts take, s.
_STAYS_S: Final = 1.3


def _judge_new(robot: Robot, judge: Judge, exchange: Exchange, body: dict[str, Any], pose: Pose, *ids: str) -> bool:
    """Judge the answer to a goal that is new, and what GET then shows, unless it has ended at its ``pose``."""
    status = exchange.response.status
    holds = judge.check("rest-resources/goal-put", status in NEW, exchange, "201 or 202 for a new goal")
    if status not in NEW and status not in REPEATED:
        return False
    goal, problem, shown = await_goal(robot, body)
    if goal is None and arrived(robot, pose):
        return holds
    for id_ in ("rest-resources/goal-get", *ids):
        judge.check(id_, not problem, shown, "the goal that was put", found=problem)
    if goal is not None:
        wrong = status_fault(goal)
        judge.check(
            "rest-resources/goal-status", not wrong, shown, "status {code, text} with code 1, 2 or 3", found=wrong
        )
    return holds and not problem


def _cancel(robot: Robot, judge: Judge, pose: Pose) -> bool:
    """Cancel the active goal; judge the status, that it is gone, and that the robot stands still in time.

    Returns:
        Whether there was one to cancel: it may have ended at its ``pose``.
    """
    drive = Drive(robot)
    exchange = robot.delete_goal(RATHER_XML)
    answered = time.monotonic()
    status = exchange.response.status
    if status == 404 and arrived(robot, pose):
        return False
    goal, none = robot.goal()
    # 202 says that it will be done; and status.code has a word for a goal that is being cancelled.
    gone = goal is None or status == 202 or goal.get("status", {}).get("code") == _CANCELING
    if gone:
        none = await_none(robot)
        gone = none.response.status == 404
    judge.check(
        "rest-resources/goal-delete",
        status in CANCELLED and gone,
        exchange if status not in CANCELLED else none,
        "204, then 404 for GET",
        found="" if status not in CANCELLED else f"GET of the goal is answered {none.came}",
    )
    drive.reach(STILL, "safety/cancel", since=answered)
    judge_drive(judge, drive.trace, robot.limits)
    return True


@pytest.mark.requirement(
    "rest-resources/goal-none",
    "rest-resources/goal-put",
    "rest-resources/goal-get",
    "rest-resources/goal-status",
    "rest-resources/goal-id",
    "rest-resources/goal-repeat",
    "rest-resources/goal-conflict",
    "rest-resources/goal-preempt",
    "rest-resources/goal-fills-in",
    "rest-resources/velocity-goal",
    "rest-resources/goal-delete",
    "rest-resources/goal-delete-none",
    "rest-resources/goal-delete-none-success",
    "safety/cancel",
    "safety/cancel-stays",
)
def test_goal_until_it_is_cancelled(robot: Robot, judge: Judge, standstill: Standstill) -> None:
    """One goal through all that clients do with it, then another in its place, then none, which lasts."""
    _judge_none(robot, judge)
    there, back = choose_goals(robot, 1.5, 2)
    frame = robot.statement.motion.frame
    # With all that may be left out; the second goal leaves it out.
    first = goal_body(there, frame, _ID)
    first["header"] = {"stamp": {"sec": 12, "nanosec": 34}, "frame_id": frame}
    first["goal_id"]["stamp"] = {"sec": 56, "nanosec": 78}
    # What was commanded before a goal is not taken up again when the goal is cancelled.
    robot.put_velocity(_slow_turn(robot))
    if not _judge_new(robot, judge, put_goal(robot, first), first, there, "rest-resources/goal-id"):
        return
    stamps = [goal["goal_id"]["stamp"] for goal in (robot.goal()[0], robot.goal()[0]) if goal is not None]
    if not _repeat(robot, judge, first, there, stamps):
        meanwhile(robot, _ID, lambda body, pose, _: _repeat(robot, judge, body, pose))
    if not _contradict(robot, judge, first, goal_body(back, frame, _ID), there):
        meanwhile(robot, _ID, lambda body, pose, other: _contradict(robot, judge, body, other, pose))
    _velocity_meanwhile(robot, judge)
    if robot.goal()[0] is None:
        put_goal(robot, first)  # a robot may end a goal when it takes a velocity
    second = goal_body(back, frame)
    second["goal"]["target_pose"]["header"]["stamp"] = {"sec": 0, "nanosec": 0}
    _displace(robot, judge, second, back)
    _await_motion(robot)
    if not _cancel(robot, judge, back):
        meanwhile(robot, _ID, lambda _, pose, __: _cancel(robot, judge, pose))
    standstill.tried(
        "safety/cancel-stays",
        "rest, and no goal, after the goal was cancelled",
        lambda: _cancel_again(robot, judge, second, back),
        seconds=_STAYS_S * robot.watchfulness,
        goal=True,
    )


def _cancel_again(robot: Robot, judge: Judge, body: dict[str, Any], pose: Pose) -> None:
    """A velocity, a goal in its place that is cancelled, and a watch of what follows."""
    robot.put_velocity(_slow_turn(robot))
    put_goal(robot, body)
    _await_motion(robot)
    _cancel(robot, judge, pose)
    _stays(robot, judge)


def _displace(robot: Robot, judge: Judge, second: dict[str, Any], pose: Pose) -> None:
    """Put another goal, without a goal_id, while one is active."""
    put = put_goal(robot, second)
    if put.response.status not in NEW | REPEATED:
        # Is it the missing id that is not taken, or another goal?
        named = put_goal(robot, second | {"goal_id": {"id": "another"}})
        taken = named.response.status in NEW | REPEATED
        name = "goal-fills-in" if taken else "goal-preempt"
        judge.check(f"rest-resources/{name}", False, put, "201 or 202 for another goal")
        return
    _judge_new(robot, judge, put, second, pose, "rest-resources/goal-preempt")
    goal, exchange = robot.goal()
    if goal is None and arrived(robot, pose):
        return
    filled = goal is not None and goal["goal_id"]["id"] not in {"", _ID}
    judge.check("rest-resources/goal-fills-in", filled, exchange, "a header and a goal_id of the robot's own")


def _judge_none(robot: Robot, judge: Judge) -> None:
    """There is no goal, and none to cancel."""
    for _ in range(3):
        exchange = await_none(robot)
        none = exchange.response.status == 404
        judge.check("rest-resources/goal-none", none, exchange, "404 without an active goal")
        exchange = robot.delete_goal()
        status = exchange.response.status
        judge.check("rest-resources/goal-delete-none", status == 404, exchange, "404 where there is nothing to cancel")
        judge.check(
            "rest-resources/goal-delete-none-success", status in {404, 200, 204}, exchange, "404 or 204 without a goal"
        )


def _repeat(
    robot: Robot, judge: Judge, body: dict[str, Any], there: Pose, stamps: Sequence[dict[str, int]] = ()
) -> bool:
    """The same goal again changes nothing, neither what is put nor its stamp, which was shown so twice.

    Returns:
        Whether that was seen: the goal may have ended ``there`` before.
    """
    for turn in range(3):
        exchange = put_goal(robot, body)
        status = exchange.response.status
        goal, shown = robot.goal()
        changed = shown.came if goal is None else difference(goal, body)
        # A robot that shows one stamp as long as nothing is asked of it shows another one for another goal.
        if not changed and stamps[1:] == stamps[:1] != [goal["goal_id"]["stamp"]]:
            changed = f"goal_id.stamp {goal['goal_id']['stamp']} for {stamps[0]}"
        if goal is None and arrived(robot, there):
            return turn > 0
        judge.check(
            "rest-resources/goal-repeat",
            status in REPEATED and not changed,
            exchange if status not in REPEATED else shown,
            "200, 202 or 204 for the goal that is active already, which stays as it is",
            found=exchange.came if status not in REPEATED else changed,
        )
    return True


def _contradict(robot: Robot, judge: Judge, body: dict[str, Any], other: dict[str, Any], there: Pose) -> bool:
    """Another pose under the active goal's id is refused.

    Returns:
        Whether that was seen: the goal may have ended ``there`` before.
    """
    exchange = put_goal(robot, other)
    status = exchange.response.status
    goal, shown = robot.goal()
    changed = shown.came if goal is None else difference(goal, body)
    if (status != 409 or goal is None) and arrived(robot, there):
        return False
    judge.check(
        "rest-resources/goal-conflict",
        status == 409 and not changed,
        exchange if status != 409 else shown,
        "409 for another pose under the active goal's id, and the goal as it was",
        found=exchange.came if status != 409 else changed,
    )
    return True


def _velocity_meanwhile(robot: Robot, judge: Judge) -> None:
    """A velocity while a goal is active is taken, and driven, or refused with 409."""
    slow, sent = _slow_turn(robot), time.monotonic()
    exchange = robot.put_velocity(slow)
    status = exchange.response.status
    judge.check(
        "rest-resources/velocity-goal", status in {200, 204, 409}, exchange, "200, 204 or 409 while a goal is active"
    )
    drive = Drive(robot)
    if exchange.response.ok and drive.look_s < _LOOK_S:
        drive.commanded(slow, sent, exchange)
        drive.reach(slow, "rest-resources/velocity-goal")
        judge_drive(judge, drive.trace, robot.limits)


def _slow_turn(robot: Robot) -> Velocity:
    return Velocity(angular_z=0.1 * robot.limits.angular_rad_s if robot.actuated(5) else 0.0)


def _await_motion(robot: Robot) -> None:
    """Wait a little until the robot moves, so that there is something to cancel."""
    until = time.monotonic() + min(1.0, robot.settle_s)
    while time.monotonic() < until:
        velocity, _ = robot.velocity()
        if velocity is None or not robot.near(velocity, STILL, 3):
            return
        time.sleep(0.02)


def _stays(robot: Robot, judge: Judge) -> None:
    """No motion and no goal come back."""
    drive = Drive(robot)
    until = time.monotonic() + _STAYS_S * robot.watchfulness
    while time.monotonic() < until:
        stays, found = drive.sees(STILL, 2)
        goal, shown = robot.goal()
        moving = stays is False
        judge.check(
            "safety/cancel-stays",
            not moving and goal is None,
            drive.trace.turns[-1].velocity_exchange if moving else shown,
            "rest, and no goal, after the goal was cancelled",
            found=f"velocity {found}" if moving else "a goal is active again",
            cause="does not stay",
        )
