"""Record whether a velocity lasts while it is renewed, while others are rejected, and beside linear PUTs."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import ANGULAR_PART, certain_s
from conformance.packs.table1.robot.no_commands import refuse_goal
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity

# Velocities beyond any limit, or in a direction without a drive; and one of the linear part alone.
_BAD: Final = (Velocity(linear_x=-1e3), Velocity(linear_x=1e308, angular_z=-1e308), Velocity(angular_z=1e4))
_BAD_LINEAR: Final = Velocity(linear_x=1e3)
# A response that takes longer lets a velocity end before all requests are sent, s.
_QUICK_S: Final = 0.02
# Time in which a robot that drops its angular velocity shows it, s.
_SHOWS_S: Final = 0.2
# Tries of what could not be seen in time.
_TRIES: Final = 3
# Tries of a velocity that was renewed too late: if nobody knows whether it can be renewed, the verdict stays open.
_RENEWED_TRIES: Final = 5
_STEP_S: Final = 0.01
# A look may take this many times as long as usual before it makes a renewal late.
_LOOKS: Final = 4


def renewed(robot: Robot, drive: Drive, turning: Velocity) -> bool:
    """Renew a velocity and send others that the robot rejects; record whether the renewed one lasts.

    Args:
        robot: the robot.
        drive: a drive whose last command was this velocity, after another one, and which has reached it.
        turning: the velocity.

    Returns:
        Whether it could be renewed in time.
    """
    expected, times = f"{turning} as long as it is renewed", _Times.of(robot.limits)
    if robot.usual_s <= _QUICK_S and times.seen_s - times.renewed_s >= _SHOWS_S:
        # One look shows that neither ends it.
        lasts, found = _renew(robot, drive, turning, times, _BAD)
        if lasts:
            for id_ in ("safety/renewal", "safety/refused-keeps"):
                drive.saw(id_, expected, holds=True)
            return True
    for _ in range(_RENEWED_TRIES):
        drive.command(STILL)
        takes_s = robot.limits.settle_s + robot.sample_s
        if robot.usual_s > _QUICK_S and takes_s < times.seen_s:
            # Reached while it is renewed: who looks for it first, at three slow answers a look, renews it too late.
            drive.command(turning)
            lasts, found = _renew(robot, drive, turning, times, (), drive.trace.answered + takes_s)
        else:
            drive.refresh(turning)
            lasts, found = _renew(robot, drive, turning, times, ())
        if lasts is not None:
            break
    drive.saw("safety/renewal", expected, found, "ended", holds=lasts)
    if lasts is not False:
        _refused(robot, drive, turning)
    return lasts is not None


@dataclass(frozen=True)
class _Times:
    """When a velocity is renewed, s after its first command.

    Attributes:
        every: interval between renewals.
        holds_s: how long the velocity certainly holds after each.
        renewed_s: end of the renewals; before the first command ends, as a robot might take the next one for a new one.
        seen_s: time of the reading, when a robot that ignores renewals has begun to stop.
    """

    every: float = 0.2
    holds_s: float = 0.5
    renewed_s: float = 1.0
    seen_s: float = 1.3

    @classmethod
    def of(cls, limits: Limits) -> _Times:
        """Return the times for a robot, with an assumed hold time where it declares none."""
        hold_s = limits.hold_s
        if hold_s is None:
            return cls()
        seen_s = min(1.05 * hold_s + 0.25 * limits.settle_s, 1.3 * hold_s)
        return cls(0.4 * hold_s, certain_s(hold_s), 0.9 * hold_s, seen_s)


def _renew(
    robot: Robot, drive: Drive, turning: Velocity, times: _Times, refused: tuple[Velocity, ...], reached: float = 0.0
) -> tuple[bool | None, str]:
    """Command the same velocity repeatedly until the first command has ended; then send velocities to be rejected.

    Args:
        robot: the robot.
        drive: a drive whose last command was this velocity.
        turning: the velocity.
        times: when to command and to look.
        refused: velocities that the robot must reject.
        reached: when the robot must have reached the velocity, s of the run's clock.

    Returns:
        Whether the robot still has the velocity (None: it was not renewed in time), and the velocity read.
    """
    first = len(drive.trace.commands) - 1
    begun = drive.trace.sent
    while drive.clock.now() < begun + times.renewed_s:
        due = drive.trace.sent + times.every
        if drive.clock.now() >= due:
            drive.command(turning)
        elif _LOOKS * drive.look_s < times.every:
            drive.look()
        else:
            drive.clock.sleep(max(_STEP_S, min(due, begun + times.renewed_s) - drive.clock.now()))
    for bad in refused:
        _put_bad(robot, bad)
    if refused:
        refuse_goal(robot)
    drive.clock.sleep(max(0.0, max(begun + times.seen_s, reached) - drive.clock.now()))
    alone = robot.usual_s > _QUICK_S
    lasts, found = drive.sees(turning, 2, until=drive.trace.sent + times.holds_s, alone=alone)
    commands = drive.trace.commands[first:]
    if any(later.answered > one.sent + times.holds_s for one, later in itertools.pairwise(commands)):
        lasts = None
    return lasts, found


def _refused(robot: Robot, drive: Drive, turning: Velocity) -> None:
    """Send velocities that the robot must reject, and record whether it turns as before."""
    for bad in _BAD:
        drive.refresh(turning)
        _put_bad(robot, bad)
        drive.look()
    refuse_goal(robot)
    drive.keep(min(_SHOWS_S, drive.holds_until - drive.clock.now()))
    keeps, found = drive.sees(turning, 2, until=drive.holds_until)
    # Where it is too late to say, the velocity of a slow robot may have ended by itself.
    expected = f"the velocity that was there before the refused ones, {turning}"
    drive.saw("safety/refused-keeps", expected, found, "changed", holds=keeps)


def _put_bad(robot: Robot, bad: Velocity) -> None:
    """Send a velocity and a linear part that the robot must reject."""
    robot.put_velocity(bad)
    robot.put_linear(_BAD_LINEAR)


def arc(robot: Robot, drive: Drive, bent: Velocity, before: Velocity) -> None:
    """PUT two linear parts, one after the other, and record whether the angular part stays.

    Args:
        robot: the robot.
        drive: a drive of that robot.
        bent: the velocity at the end.
        before: the first linear part.
    """
    back = bent._replace(angular_z=0.0)
    drive.refresh(bent)
    if not drive.command(before, linear=True):
        return
    for attempt in range(_TRIES):
        if attempt or robot.usual_s > _QUICK_S:
            # Whether a PUT of the linear part renews the angular one too is the robot's affair: so again, and in time.
            drive.refresh(bent)
        drive.command(back, linear=True)
        drive.keep(min(_SHOWS_S, drive.holds_until - drive.clock.now()))
        keeps, found = drive.sees(bent, 1.5, part=ANGULAR_PART, until=drive.holds_until)
        if keeps is not None:
            break
    expected = f"the angular part as it was before the linear PUT, {bent}"
    drive.saw("rest-resources/linear-keeps-angular", expected, found, "changed", holds=keeps)
