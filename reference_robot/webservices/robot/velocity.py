"""The robot's velocity: the measured one, and commands from clients."""

import asyncio
import time
from collections.abc import Callable
from typing import Any, Final

from geometry_msgs.msg import Twist

from reference_robot.webservices.configuration import WebSettings
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.representation.messages import message_from, reader_of
from reference_robot.webservices.representation.problems import Problem, not_yet
from reference_robot.webservices.representation.shapes import shape_of
from reference_robot.webservices.robot.odometry import LatestOdometry

_DISCOVERY: Final = 1.0  # seconds to wait for a robot's subscription
_STEP: Final = 0.02


class Velocity:
    """The measured velocity of the robot, and the sender of velocity commands."""

    def __init__(
        self,
        publishers: RobotPublishersNode,
        odometry: LatestOdometry,
        settings: WebSettings,
        goal_is_active: Callable[[], bool],
    ) -> None:
        self._publishers = publishers
        self._odometry = odometry
        self._settings = settings
        self._goal_is_active = goal_is_active
        self._read = reader_of(Twist)
        self._commanded: dict[str, Any] | None = None
        self._commanded_at = 0.0
        self._watchdog = VelocityWatchdog(settings.hold, self._stop)

    def read(self) -> dict[str, Any]:
        """Return the measured velocity as a dict with the fields of a geometry_msgs/Twist, in m/s and rad/s.

        Raises:
            Problem: 503, if there is no odometry of the last second.
        """
        return self._read(self._odometry.message().twist.twist)

    async def command(self, twist: dict[str, Any]) -> None:
        """Publish a velocity, a dict with the fields of a Twist, once; a watchdog ends it after the hold time.

        The watchdog is the robot's own or the one of these web services.

        Raises:
            Problem: 422 for a value beyond the limits or a component that a differential drive cannot actuate, 409
                while a goal is active, 503 if no robot subscribes to velocities, or if it is unknown whether a goal is
                active and the velocity is not zero.
        """
        self._check_limits(twist)
        is_moving = any(value for part in twist.values() for value in part.values())
        if self._gives_way_to_goal(is_moving=is_moving):
            raise Problem(409, "the robot follows a goal; cancel it before setting a velocity")
        await self._robot_found()
        self._commanded, self._commanded_at = twist, time.monotonic()
        if is_moving:
            self._watchdog.renew()
        give_up = time.monotonic() + (0.0 if is_moving else self._settings.deadline)
        while not self._publishers.publish_velocity(message_from(shape_of(Twist), twist)):
            if time.monotonic() >= give_up:
                raise not_yet("the robot does not receive velocity commands fast enough")
            await asyncio.sleep(_STEP)  # a loaded machine delays the middleware; a stop is sent again
        if not is_moving:
            self._watchdog.release()

    async def command_linear(self, linear: dict[str, float]) -> None:
        """Publish a velocity with a new linear part and the angular part that is in force.

        The angular part of the last command is in force during the hold time; afterwards it is zero. A robot that has
        stopped must not start to turn again.
        """
        held = self._commanded
        if held is None or time.monotonic() - self._commanded_at >= self._settings.hold:
            angular = {"x": 0.0, "y": 0.0, "z": 0.0}
        else:
            angular = held["angular"]
        await self.command({"linear": linear, "angular": angular})

    def close(self) -> None:
        """Stop the robot if a velocity from these web services is in force, before this process ends."""
        self._watchdog.close()
        self._publishers.await_velocity_taken()

    def _stop(self) -> bool:
        """Publish zero velocity, unless the robot follows a goal: then the navigation controls the velocity.

        Return False if publishing failed.
        """
        return self._gives_way_to_goal(is_moving=False) or self._publishers.publish_velocity(Twist())

    def _gives_way_to_goal(self, *, is_moving: bool) -> bool:
        """Return whether a goal is active. While that is unknown, stopping is safe, and moving raises the Problem."""
        try:
            return self._goal_is_active()
        except Problem:
            if is_moving:
                raise
            return False

    def _check_limits(self, twist: dict[str, Any]) -> None:
        web = self._settings
        reverse = web.max_linear if web.max_reverse is None else web.max_reverse
        ranges = {
            ("linear", "x"): (-reverse, web.max_linear),
            ("linear", "y"): (-web.max_lateral, web.max_lateral),
            ("angular", "z"): (-web.max_angular, web.max_angular),
        }
        for part, components in twist.items():
            for axis, value in components.items():
                least, most = ranges.get((part, axis), (0.0, 0.0))
                if least == most and value != 0:
                    raise Problem(422, f"{part}.{axis} must be 0: this robot cannot actuate it, not {value}")
                if not least <= value <= most:
                    unit = "m/s" if part == "linear" else "rad/s"
                    raise Problem(422, f"{part}.{axis} must lie within {least} and {most} {unit}, not {value}")
        ahead, turn = twist["linear"]["x"], twist["angular"]["z"]
        if abs(ahead) < web.min_radius * abs(turn):
            raise Problem(
                422, f"angular.z must be at most {abs(ahead) / web.min_radius} rad/s beside linear.x, not {turn}"
            )

    async def _robot_found(self) -> None:
        give_up = time.monotonic() + _DISCOVERY
        while not self._publishers.find_velocity_subscribers():
            if time.monotonic() > give_up:
                raise not_yet("no robot on the ROS graph subscribes to velocity commands")
            await asyncio.sleep(_STEP)


_AGAIN_S: Final = 0.02  # after a stop that could not be sent
_AT_LAST: Final = 50  # attempts before this process ends


class VelocityWatchdog:
    """A timer that calls ``stop`` when a velocity has not been renewed for ``hold`` seconds, until it returns True.

    It only ends velocities from these web services, not those of other ROS nodes. It needs one event-loop timer while a
    velocity is in force.
    """

    def __init__(self, hold: float, stop: Callable[[], bool]) -> None:
        self._hold = hold
        self._stop = stop
        self._ends_at = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def renew(self) -> None:
        """Restart the hold time, because a velocity was just sent; call on the event loop's thread."""
        loop = asyncio.get_running_loop()
        self._ends_at = loop.time() + self._hold
        if self._timer is None:  # a running timer checks `_ends_at` itself; cheaper than a new timer each time
            self._timer = loop.call_at(self._ends_at, self._look, loop)

    def release(self) -> None:
        """Cancel the timer, because no velocity is in force any more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def close(self) -> None:
        """Stop the robot now if a velocity is in force; works also after the event loop has ended."""
        if self._timer is not None:
            self.release()
            for _ in range(_AT_LAST):
                if self._stop():
                    return
                time.sleep(_AGAIN_S)

    def _look(self, loop: asyncio.AbstractEventLoop) -> None:
        if loop.time() < self._ends_at:
            self._timer = loop.call_at(self._ends_at, self._look, loop)
            return
        self._timer = None if self._stop() else loop.call_later(_AGAIN_S, self._look, loop)
