"""The slowest and fastest velocities of the range that a robot declares; it must accept and reach them."""

from collections.abc import Iterator
from typing import Final

from conformance.packs.table1.robot.abilities import ABOUT, AHEAD, handiest, turn_beside
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity

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
        drive.refused(ids[0] if ids else "rest-resources/velocity-range", expected)
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
