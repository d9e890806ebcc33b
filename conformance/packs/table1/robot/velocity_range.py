"""Velocities of the range that a robot declares: the slowest and fastest, and those that are not renewed."""

import math
import random
from collections.abc import Iterator
from typing import Final

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.motion_map import By
from conformance.packs.table1.robot.robot import ABOUT, AHEAD, STILL, Robot, Velocity, handiest, turn_beside

# Share of the assumed figures that a robot may reach where it declares no limits.
_UNDECLARED: Final = 0.6
# Factor on that for a drive, which needs more room than a turn.
_SLOWER: Final = 0.5
# A robot faster than this multiple of tolerance and noise does not rest.
_MOVES: Final = 1.6


def slowest(robot: Robot) -> Velocity:
    """Return a velocity ahead and to the left that just differs from rest, at most half of the limits."""
    return robot.drivable(Velocity(linear_x=_slowest(robot, AHEAD), angular_z=_slowest(robot, ABOUT)))


def slowest_along(robot: Robot, component: int) -> Velocity:
    """Return a velocity in one component that just differs from rest, at most half of its limit."""
    return robot.only(component, _slowest(robot, component))


def _slowest(robot: Robot, component: int) -> float:
    return min(_MOVES * robot.limits.rest(component), 0.5 * fastest(robot, component))


def fastest(robot: Robot, component: int, sign: int = 1) -> float:
    """Return the extreme velocity that the suite commands in one component and direction, m/s or rad/s.

    It is 0 where the robot does not move in that direction.
    """
    least, greatest = robot.limits.range_of(component)
    return (greatest if sign > 0 else least) * (1.0 if robot.limit_declared(component) else _UNDECLARED)


def handy(robot: Robot, share: float) -> Velocity:
    """Return a velocity by which a robot moves with little room: a share of the limit of turning, or else of driving.

    A robot that cannot turn without driving turns in its narrowest circle.
    """
    component = handiest(robot.statement.motion)
    part = 1.0 if component >= len("xyz") else _SLOWER
    return robot.only(component, part * robot.share(component, share))


def both(robot: Robot) -> Velocity:
    """Return the fastest left turn during the fastest drive, if the statement declares how both depend."""
    return robot.drivable(Velocity(linear_x=fastest(robot, AHEAD, direction(robot)), angular_z=fastest(robot, ABOUT)))


def along_arc(robot: Robot, turning: Velocity, share: float) -> tuple[Velocity, Velocity]:
    """Return a turn along an arc, and a second linear part that allows the same turn.

    The robot drives back and then ahead, unless it hardly drives back: then it drives ahead at two speeds. ``share``:
    of the limit, how fast it drives.
    """
    limits, motion = robot.limits, robot.statement.motion
    least, greatest = limits.range_of(AHEAD)
    aside, other = (-share, share) if -least >= greatest / 2 else (share, share / 2)
    parts = [robot.share_of_limits(number, 0.0).linear_x for number in (aside, other)]
    turn = turning.angular_z
    for part in parts:
        turn = turn_beside(limits, motion, part, turn)
    return Velocity(linear_x=parts[0], angular_z=turn), Velocity(linear_x=parts[1])


def reach(drive: Drive, velocity: Velocity, *ids: str) -> bool:
    """Command a velocity in the declared range; return whether the robot accepts and reaches it.

    ``ids`` are the requirements that say so; by default those on every velocity that the robot can drive.
    """
    if not drive.command(velocity):
        expected = f"2xx for {velocity}, which is within the declared limits"
        drive.note_refusal(ids[0] if ids else "rest-resources/velocity-range", expected)
        return False
    return drive.reach(velocity, *(ids or ("rest-resources/velocity-converges", "rest-resources/velocity-range")))


def there_and_back(drive: Drive, changes: int) -> Iterator[tuple[int, Velocity]]:
    """Yield the number of each change and a velocity that the robot has: along an arc, then rest, and back."""
    robot = drive.robot
    for change in range(changes):
        arc = robot.share_of_limits(0.3, -0.4)
        moving = robot.drivable(Velocity(*(-part if change % 2 else part for part in arc)))
        for wanted in (moving, STILL):
            drive.command(wanted)
            drive.reach(wanted)
            yield change, wanted


def direction(robot: Robot) -> int:
    """Return 1 (ahead) where the arena has room ahead or the robot has no reverse gear, else -1 (back)."""
    pose = robot.map_pose()
    return 1 if pose is None or not robot.reverses or robot.in_arena(pose.ahead(robot.limits.linear_m_s)) else -1


# _SLOW: slow velocity, as a share of its limit. _TOLD: as a multiple of what may pass for rest. Below: at most this
# share.
_SLOW: Final = 0.1
_TOLD: Final = 4
_MOST: Final = 0.6


def unrenewed_velocities(
    bent: Velocity, ahead: Velocity, across: Velocity, others: tuple[Velocity, ...], effort: str, seed: int
) -> list[tuple[Velocity, By]]:
    """Return velocities to send without renewal, and how each is commanded last.

    A robot may keep a watchdog for each path, for each sign, for each part, and for small or large velocities. At the
    effort "quick" the seed says which one is tried.

    Args:
        bent: a velocity along an arc.
        ahead: its opposite, or as much of it as the robot can drive.
        across: the same to the other side.
        others: velocities of another size or with one part alone; the first one's connection is closed.
        effort: quick, standard or deep.
        seed: of the run.
    """
    ways: list[tuple[Velocity, By]] = [
        (bent, "linear" if bent.linear_x else "velocity"),
        (bent, "velocity"),
        (ahead, "linear" if ahead.linear_x else "velocity"),
        *((one, "velocity" if number else "closing") for number, one in enumerate(others)),
        (across, "velocity"),
        (ahead, "xml"),
    ]
    if effort == "deep" or not any(velocity.linear_x * ahead.linear_x > 0 for velocity in others):
        ways.append((ahead, "velocity"))
    ways = [way for way in dict.fromkeys(ways) if any(way[0])]
    if effort == "quick":
        return random.Random(f"{seed}/ways").sample(ways, min(1, len(ways)))  # noqa: S311 - no secret
    return ways


def slow(robot: Robot, seed: int) -> list[Velocity]:
    """Return a slow drive and a slow turn that differ from rest, in directions that the seed chooses."""
    limits, chance = robot.limits, random.Random(f"{seed}/slow")  # noqa: S311 - no secret
    found: list[Velocity] = []
    for component in (AHEAD, ABOUT):
        end = chance.choice([number for number in limits.range_of(component) if number] or [0.0])
        size = min(max(_SLOW * abs(end), _TOLD * limits.rest(component)), _MOST * abs(end))
        found.append(robot.only(component, math.copysign(size, end)))
    return found
