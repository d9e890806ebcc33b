"""A velocity that has to stay as it is, whatever is refused meanwhile; and its angular part beside a linear PUT."""

import time
from typing import Final

from conformance.robot.drive import Drive
from conformance.robot.robot import Robot, Velocity
from conformance.verdict.evidence import Judge

# Beyond any limit, or not to be actuated; and by the linear part alone.
_BAD: Final = (Velocity(linear_x=-1e3), Velocity(linear_x=1e308, angular_z=-1e308), Velocity(angular_z=1e4))
_BAD_LINEAR: Final = Velocity(linear_x=1e3)
# Where an answer takes longer, a velocity may end before all of them are sent, s.
_QUICK_S: Final = 0.02
# A robot that drops its angular velocity needs so long to show it, s.
_SHOWS_S: Final = 0.2
# What could not be seen in time is tried so often.
_TRIES: Final = 3
ANGULAR: Final = slice(3, 6)


def judge_undisturbed(robot: Robot, drive: Drive, judge: Judge, turning: Velocity) -> None:
    """Judge a robot that turns: what it refuses disturbs nothing, and a PUT of the linear part leaves the angular one.

    Args:
        robot: with its limits.
        drive: that turns.
        judge: is told of safety/refused-keeps and rest-resources/linear-keeps-angular.
        turning: the velocity that was commanded.
    """
    if not _undisturbed(robot, drive, judge, turning):
        _refused(robot, drive, judge, turning)
        if robot.actuated(0):
            _arc(robot, drive, judge, turning)


def _undisturbed(robot: Robot, drive: Drive, judge: Judge, turning: Velocity) -> bool:
    """What is refused on an arc: one look shows that the arc has both its parts, and keeps them.

    Returns:
        Whether it does. Else each is tried by itself, to learn what ends it.
    """
    if not robot.actuated(0) or robot.usual_s > _QUICK_S:
        return False
    ahead, back = (Velocity(linear_x=share * robot.limits.linear_m_s) for share in (0.3, -0.3))
    drive.refresh(turning)
    if not drive.command_linear(ahead) or not drive.command_linear(back):
        return False
    for bad in _BAD:
        robot.put_velocity(bad)
        robot.put_linear(_BAD_LINEAR)
    drive.keep(min(_SHOWS_S, drive.holds_until - time.monotonic()))
    arc = turning._replace(linear_x=back.linear_x)
    if not drive.sees(arc, 1.5, until=drive.holds_until)[0]:
        return False
    for id_ in ("rest-resources/linear-keeps-angular", "safety/refused-keeps"):
        exchange = drive.trace.turns[-1].velocity_exchange
        judge.check(id_, holds=True, exchange=exchange, expected=f"{arc}, as it was commanded")
    return True


def _refused(robot: Robot, drive: Drive, judge: Judge, turning: Velocity) -> None:
    """What is refused leaves the robot turning as it did."""
    for bad in _BAD:
        drive.refresh(turning)
        robot.put_velocity(bad)
        robot.put_linear(_BAD_LINEAR)
        drive.look()
    drive.keep(min(_SHOWS_S, drive.holds_until - time.monotonic()))
    keeps, found = drive.sees(turning, 2, until=drive.holds_until)
    if keeps is None:
        return  # a slow robot: its velocity may have ended by itself
    judge.check(
        "safety/refused-keeps",
        keeps,
        drive.trace.turns[-1].velocity_exchange,
        f"the velocity that was there before the refused ones, {turning}",
        found=found,
        cause="changed",
    )


def _arc(robot: Robot, drive: Drive, judge: Judge, turning: Velocity) -> None:
    """A linear part beside the angular one, ahead and then back."""
    ahead, back = (Velocity(linear_x=share * robot.limits.linear_m_s) for share in (0.3, -0.3))
    drive.refresh(turning)
    if not drive.command_linear(ahead):
        return
    for _ in range(_TRIES):
        # Whether a PUT of the linear part renews the angular one too is the robot's affair: so again, and in time.
        drive.refresh(turning)
        drive.command_linear(back)
        drive.keep(min(_SHOWS_S, drive.holds_until - time.monotonic()))
        keeps, found = drive.sees(turning, 1.5, part=ANGULAR, until=drive.holds_until)
        if keeps is not None:
            break
    else:
        judge.note("rest-resources/linear-keeps-angular", "answers came too late to see it within the hold time")
        return
    judge.check(
        "rest-resources/linear-keeps-angular",
        keeps,
        drive.trace.turns[-1].velocity_exchange,
        f"the angular part as it was before the linear PUT, {turning}",
        found=found,
        cause="changed",
    )
