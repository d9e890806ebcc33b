"""Turning: as fast as the robot can, renewed whatever is refused, bent into an arc, and at last left to itself."""

import math
import random
import time
from typing import Final

import pytest

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import Turn
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.letting_go import LetGo
from conformance.packs.table1.robot.robot import FARTHEST, STILL, Robot, Velocity
from conformance.packs.table1.robot.undisturbed import ANGULAR, judge_arc, judge_renewed
from conformance.packs.table1.robot.velocity_range import direction, fastest, reach
from conformance.packs.table1.robot.windows import LONGEST_SAMPLE_S, SEVERAL
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]
# Where no hold time is declared a velocity has to end within so long, s.
_ENDS_S: Final = 10.0
_LINEAR: Final = slice(0, 3)
# Of the hold time: so long after a command it is given again, and holds from then on.
_AGAIN: Final = 0.25
# How often it is tried to tell how long a velocity holds.
_ATTEMPTS: Final = 3
# In this time several samples come, from any robot, s.
_SAMPLES_S: Final = (SEVERAL + 1) * LONGEST_SAMPLE_S


@pytest.mark.requirement(
    "rest-resources/velocity-integers",
    "rest-resources/velocity-converges",
    "rest-resources/velocity-range",
    "rest-resources/linear-put",
    "rest-resources/linear-keeps-angular",
    "rest-resources/pose-rotation",
    "safety/refused-keeps",
    "safety/renewal",
    "safety/hold",
    "safety/hold-ends",
    "safety/watchdog",
    "safety/limits-hold",
)
def test_turn(robot: Robot, judge: Judge, run: Run) -> None:
    """Turns of about four seconds, of which the robot ends one by itself; another one too, where there is time."""
    if not robot.actuated(5):
        pytest.skip("the statement says that the robot cannot turn on the spot")
    make_room(robot)
    drive = Drive(robot)
    _turn(robot, drive, judge)
    for velocity in _further(robot, run):
        _let_go(robot, drive, judge, velocity)
    drive.judge_motion()


def _further(robot: Robot, run: Run) -> list[Velocity]:
    """Velocities at the ends of the range, which hold as long as others: one of them, by the seed, or both."""
    limits = robot.limits
    if limits.hold_s is None:
        return []
    told_from_rest = 4 * (limits.tolerance_angular_rad_s + FARTHEST * limits.noise.angular_rad_s)
    slow = Velocity(angular_z=min(max(0.2 * limits.angular_rad_s, told_from_rest), 0.6 * limits.angular_rad_s))
    choices = [slow, _fast_left(robot)]
    number = {"quick": 0, "standard": 1}.get(run.effort.name, len(choices))
    return random.Random(f"{run.seed}/let go").sample(choices, number)  # noqa: S311 - no secret


def _turn(robot: Robot, drive: Drive, judge: Judge) -> None:
    limit = robot.limits.angular_rad_s
    drive.look()
    # 1 rad/s is the only whole number below the limits of most robots.
    left = Velocity(angular_z=1.0 if limit > 1.1 else 0.0)
    if drive.command(left, integers=True):
        drive.reach(left, "rest-resources/velocity-integers", "rest-resources/velocity-converges")
    if not left.angular_z:
        left = Velocity(angular_z=0.6 * limit)
        drive.command(left)
        drive.reach(left, "rest-resources/velocity-converges")
    renewed = _fast(robot, drive)
    if renewed is None:
        drive.refresh(left)
    judge_renewed(robot, drive, judge, renewed or left)
    arc = Velocity(angular_z=-left.angular_z)
    if robot.actuated(0):
        # A small circle: either part has to end. The linear part is commanded last, and ends as well.
        arc = arc._replace(linear_x=-0.3 * robot.limits.linear_m_s)
        judge_arc(robot, drive, judge, arc)
    _let_go(robot, drive, judge, arc)
    if robot.actuated(0):
        _ahead_from_rest(robot, drive, judge)


def _fast(robot: Robot, drive: Drive) -> Velocity | None:
    """Turn left, and right on the spot, with which it goes on; both as fast as the robot can.

    Returns:
        That velocity, where it is reached.
    """
    right = Velocity(angular_z=-fastest(robot, 5))
    return right if reach(drive, _fast_left(robot)) and reach(drive, right) else None


def _fast_left(robot: Robot) -> Velocity:
    """As fast as the robot can: also ahead, or back where there is no room, where the limits say so."""
    ahead = 0.0
    if robot.actuated(0) and robot.limit_declared(0) and robot.limit_declared(5):
        ahead = direction(robot) * fastest(robot, 0)
    return Velocity(linear_x=ahead, angular_z=fastest(robot, 5))


def _ahead_from_rest(robot: Robot, drive: Drive, judge: Judge) -> None:
    """A linear part after the angular one has ended by itself: that one is zero, and stays so."""
    ahead = Velocity(linear_x=0.3 * robot.limits.linear_m_s)
    if not drive.command_linear(ahead):
        return
    drive.reach(ahead, "rest-resources/linear-put", part=_LINEAR)
    keeps, found = drive.sees(ahead, 1.5, part=ANGULAR)
    robot.put_velocity(STILL)
    if keeps is not None:
        judge.check(
            "rest-resources/linear-keeps-angular",
            keeps,
            drive.trace.turns[-1].velocity_exchange,
            f"no angular part beside {ahead}: the one before it had ended",
            found=found,
            cause="came back",
        )


def _let_go(robot: Robot, drive: Drive, judge: Judge, turning: Velocity) -> None:
    """No more renewal: the velocity holds for its time, begins to stop, and ends by itself.

    What fails is tried again: an answer that came late, or a robot whose machine was busy, is no failure.
    """
    limits = robot.limits
    if limits.hold_s is None:
        judge.note("safety/hold", "no hold time is declared: judged is only that a velocity lasts until it is reached")
        judge.note("safety/hold-ends", "no hold time is declared")
    attempts = _ATTEMPTS if limits.hold_s else 1
    while True:
        let_go = _watch(robot, drive, turning)
        if let_go is None:
            return
        attempts -= 1
        early, late, rests = let_go.early(limits), let_go.late(limits), let_go.rests(limits)
        if not rests:
            robot.put_velocity(STILL)
        if (early is None and late is None and rests) or not attempts:
            break
    if let_go.is_void(limits) and (early is not None or late is not None):
        for name in ("safety/hold", "safety/hold-ends"):
            judge.skip(name, "answers came too late to tell how long a velocity holds")
    else:
        _judge_hold(judge, let_go, limits, early, late)
    judge.check(
        "safety/watchdog",
        rests,
        let_go.turns[-1].velocity_exchange,
        f"rest within {_ends_by(robot):.1f} s of a command that is not renewed",
        found=str(let_go.turns[-1].velocity or ""),
        cause="goes on",
    )


def _judge_hold(judge: Judge, let_go: LetGo, limits: Limits, early: Turn | None, late: Turn | None) -> None:
    turn = early or let_go.turns[0]
    if early is None and limits.hold_s is not None and not let_go.was_held(limits):
        judge.skip("safety/hold", "answers came too late to see a velocity in its hold time")
    else:
        judge.check(
            "safety/hold",
            early is None,
            turn.velocity_exchange,
            f"{let_go.velocity} for {limits.hold_s or 0:g} s after the command",
            found=f"{turn.velocity} {turn.at - let_go.full:.2f} s after it",
            cause="ended early",
        )
    if limits.hold_s is not None:
        turn = late or let_go.turns[-1]
        judge.check(
            "safety/hold-ends",
            late is None,
            turn.velocity_exchange,
            f"a robot that begins to stop {limits.hold_s:g} s after the command, at the latest after "
            f"{let_go.longest(limits):.2f} s",
            found=f"{turn.velocity} {turn.at - let_go.answered:.2f} s after it",
            cause="holds too long",
        )


def _ends_by(robot: Robot) -> float:
    """How long after its command a velocity has to have ended, s."""
    hold = robot.limits.hold_s
    return _ENDS_S if hold is None else 1.1 * hold + robot.settle_s


def _watch(robot: Robot, drive: Drive, turning: Velocity) -> LetGo | None:
    """Command a velocity, and look until the robot rests, or has to; None where it is not taken.

    Where the hold time is declared nobody asks around its end: what ends a velocity is time, not a question, and what
    is refused does not renew it.
    """
    limits, last = robot.limits, drive.trace.last_full
    if last is None or last.velocity != turning or time.monotonic() > drive.holds_until:
        drive.refresh(turning)
    if limits.hold_s is not None:
        # So long that a robot which takes the next command for a repetition of this one ends it clearly too early.
        drive.keep(drive.trace.full_sent + _AGAIN * limits.hold_s - time.monotonic())
    if not drive.command(turning):
        return None
    full = drive.trace.sent
    if turning.linear_x and limits.hold_s is not None:
        drive.command_linear(turning)
    answered = drive.trace.answered
    first, resumed = len(drive.trace.turns), None
    ends = answered + _ends_by(robot)
    silent_from = math.inf if limits.hold_s is None else full + 0.95 * limits.hold_s
    while True:
        drive.look()
        let_go = LetGo(turning, full, answered, drive.trace.turns[first:], resumed)
        if let_go.rests(limits) or drive.trace.turns[-1].at > ends:
            return let_go
        if resumed is None and time.monotonic() > silent_from:
            robot.put_velocity(Velocity(angular_z=1e4))
            time.sleep(max(0.0, answered + let_go.longest(limits) - time.monotonic()))
            resumed = len(let_go.turns)
            ends = max(ends, time.monotonic() + _SAMPLES_S)
