"""Turning on the spot: renewed, bent into an arc, disturbed by what is refused, and at last left to itself."""

import time
from typing import Final

import pytest

from conformance.robot.drive import Drive
from conformance.robot.goals import make_room
from conformance.robot.robot import STILL, Robot, Velocity
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]
# Where no hold time is declared: a velocity is renewed so often, for so long, and has to end within so long, s.
_RENEW_S: Final = 0.2
_KEEP_S: Final = 1.3
_ENDS_S: Final = 10.0
_LINEAR: Final = slice(0, 3)
# A robot that drops its angular velocity needs so long to show it, s.
_SHOWS_S: Final = 0.2
# A robot that takes so long to answer may not be asked often enough within its hold time, s.
_SLOW_S: Final = 0.05


@pytest.mark.requirement(
    "rest-resources/velocity-integers",
    "rest-resources/velocity-converges",
    "rest-resources/linear-put",
    "rest-resources/linear-keeps-angular",
    "rest-resources/pose-rotation",
    "safety/refused-keeps",
    "safety/renewal",
    "safety/hold",
    "safety/watchdog",
    "safety/limits-hold",
)
def test_turn(robot: Robot, judge: Judge) -> None:
    """One turn of about three seconds; the robot ends it by itself."""
    if not robot.actuated(5):
        pytest.skip("the statement says that the robot cannot turn on the spot")
    make_room(robot)
    drive = Drive(robot)
    _turn(robot, drive, judge)
    drive.judge_motion()


def _turn(robot: Robot, drive: Drive, judge: Judge) -> None:
    limit = robot.limits.angular_rad_s
    # 1 rad/s is the only whole number below the limits of most robots.
    turning = Velocity(angular_z=1.0 if limit > 1.1 else 0.0)
    started = time.monotonic()
    drive.look()
    if drive.command(turning, integers=True):
        drive.reach(turning, "rest-resources/velocity-integers", "rest-resources/velocity-converges")
    if not turning.angular_z:
        turning = Velocity(angular_z=0.6 * limit)
        drive.command(turning)
        drive.reach(turning, "rest-resources/velocity-converges")
    _refused(robot, drive, judge, turning)
    if robot.actuated(0):
        _arc(robot, drive, judge, turning)
    _renew(robot, drive, judge, turning, started)
    _let_go(robot, drive, judge, turning, started)


def _refused(robot: Robot, drive: Drive, judge: Judge, turning: Velocity) -> None:
    """What is beyond any limit, or not to be actuated, leaves the robot turning as it did."""
    for bad in (Velocity(linear_x=-1e3), Velocity(linear_x=1e308, angular_z=-1e308), Velocity(angular_z=1e4)):
        drive.refresh(turning)
        robot.put_velocity(bad)
        robot.put_linear(Velocity(linear_x=1e3))
        drive.look()
    drive.keep(min(_SHOWS_S, drive.holds_until - time.monotonic()))
    velocity, exchange = drive.look()
    if time.monotonic() > drive.holds_until:
        return  # a slow robot: its velocity may have ended by itself
    judge.check(
        "safety/refused-keeps",
        velocity is not None and robot.near(velocity, turning, 2),
        exchange,
        f"the velocity that was there before the refused ones, {turning}",
        found=str(velocity) if velocity else "",
        cause="changed",
    )


def _arc(robot: Robot, drive: Drive, judge: Judge, turning: Velocity) -> None:
    """A linear part beside the angular one, and away again."""
    ahead = Velocity(linear_x=0.3 * robot.limits.linear_m_s)
    drive.refresh(turning)
    if not drive.command_linear(ahead):
        return
    drive.reach(ahead, "rest-resources/linear-put", part=_LINEAR)
    # Whether a PUT of the linear part renews the angular one too is the robot's affair: so again, and in time.
    drive.refresh(turning)
    drive.command_linear(ahead)
    drive.keep(min(_SHOWS_S, drive.holds_until - time.monotonic()))
    velocity, exchange = drive.look()
    if time.monotonic() > drive.holds_until and robot.usual_s > _SLOW_S:
        return
    judge.check(
        "rest-resources/linear-keeps-angular",
        velocity is not None and robot.near(Velocity(0.0, 0.0, 0.0, *velocity[3:]), turning, 1.5),
        exchange,
        f"the angular part as it was before the linear PUT, {turning}",
        found=str(velocity) if velocity else "",
        cause="changed",
    )


def _renew(robot: Robot, drive: Drive, judge: Judge, turning: Velocity, started: float) -> None:
    """Keep turning; where the hold time is known, for so long that the first command ends before the last one does."""
    hold = robot.limits.hold_s
    until = started + (_KEEP_S if hold is None else robot.limits.settle_s + 0.2)
    drive.command(turning)
    drive.reach(turning)
    while True:
        if time.monotonic() > drive.trace.answered + (_RENEW_S if hold is None else 0.4 * hold):
            drive.command(turning)
        _judge_renewed(judge, turning, *drive.look())
        if time.monotonic() > until:
            return


def _judge_renewed(judge: Judge, turning: Velocity, velocity: Velocity | None, exchange: Exchange) -> None:
    judge.check(
        "safety/renewal",
        # A reading that is none is judged as such.
        velocity is None or abs(velocity.angular_z) > 0.5 * abs(turning.angular_z),
        exchange,
        f"{turning} as long as it is renewed",
        found=str(velocity) if velocity else "",
        cause="ended",
    )


def _let_go(robot: Robot, drive: Drive, judge: Judge, turning: Velocity, started: float) -> None:
    """No more renewal: the velocity holds for its time, and then ends by itself."""
    limits = robot.limits
    if robot.actuated(0):
        # A small circle: either part has to end. The linear part is commanded last, and ends as well.
        turning = turning._replace(linear_x=0.2 * limits.linear_m_s)
        drive.refresh(turning)
    if not drive.command(turning):
        return
    full = drive.trace.sent
    if robot.actuated(0) and limits.hold_s is not None:
        drive.command_linear(turning)
    holds_until = full + (0.95 * limits.hold_s - 0.02 if limits.hold_s is not None else 0.0)
    answered = drive.trace.answered
    ends_by = answered + (1.1 * limits.hold_s + robot.settle_s if limits.hold_s is not None else _ENDS_S)
    calm = 0
    if limits.hold_s is None:
        judge.note("safety/hold", "no hold time is declared: judged is only that a velocity lasts until it is reached")
    while True:
        asked = time.monotonic()
        velocity, exchange = drive.look()
        there = velocity is None or robot.near(velocity, turning, 1.5)
        if time.monotonic() < holds_until or (limits.hold_s is None and not calm and asked < answered + 0.1):
            judge.check(
                "safety/hold",
                there,
                exchange,
                f"{turning} for {limits.hold_s or 0:g} s after the command",
                found=str(velocity) if velocity else "",
                cause="ended early",
            )
            if limits.hold_s is not None and asked > started + limits.hold_s + limits.settle_s:
                _judge_renewed(judge, turning, velocity, exchange)
        calm = calm + 1 if velocity is not None and robot.near(velocity, STILL) else 0
        if calm > 1 or asked > ends_by:
            break
    judge.check(
        "safety/watchdog",
        calm > 0,
        exchange,
        f"rest within {ends_by - answered:.1f} s of a command that is not renewed",
        found=str(velocity) if velocity else "",
        cause="goes on",
    )
    if not calm:
        robot.put_velocity(STILL)
