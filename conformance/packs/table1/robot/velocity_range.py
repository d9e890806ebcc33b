"""The slowest and fastest velocities of the range that a robot declares; it must accept and reach them."""

from typing import Final

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.robot import FARTHEST, Robot, Velocity

# Where no limits are declared the robot may be slower than the figures that it is judged by.
_UNDECLARED: Final = 0.6
# So many times as fast as what may still be rest, by its tolerance and its noise, a robot does not rest.
_MOVES: Final = 1.6


def slowest(robot: Robot) -> Velocity:
    """Return a velocity ahead and to the left that just differs from rest, at most half of the limits."""
    limits = robot.limits
    linear = _MOVES * (limits.tolerance_linear_m_s + FARTHEST * limits.noise.linear_m_s)
    angular = _MOVES * (limits.tolerance_angular_rad_s + FARTHEST * limits.noise.angular_rad_s)
    return Velocity(
        linear_x=min(linear, 0.5 * fastest(robot, 0)) if robot.actuated(0) else 0.0,
        angular_z=min(angular, 0.5 * fastest(robot, 5)) if robot.actuated(5) else 0.0,
    )


def fastest(robot: Robot, component: int) -> float:
    """Return the highest speed that the suite commands in one component, m/s or rad/s."""
    return robot.limit_of(component) * (1.0 if robot.limit_declared(component) else _UNDECLARED)


def reach(drive: Drive, velocity: Velocity) -> bool:
    """Command a velocity in the declared range; return whether the robot accepts and reaches it."""
    if not drive.command(velocity):
        drive.refused("rest-resources/velocity-range", f"2xx for {velocity}, which is within the declared limits")
        return False
    return drive.reach(velocity, "rest-resources/velocity-converges", "rest-resources/velocity-range")


def direction(robot: Robot) -> int:
    """Return 1 (ahead) where the arena has room ahead, else -1 (back)."""
    pose = robot.map_pose()
    return 1 if pose is None or robot.in_arena(pose.ahead(robot.limits.linear_m_s)) else -1
