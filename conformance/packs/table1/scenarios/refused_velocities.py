"""Velocities that the robot must reject: beyond its limits, or in components that it does not actuate."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from conformance.api.rest.calls import JSON
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.invalid_bodies import elsewhere
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import LINEAR, STILL, VELOCITY, Robot, Velocity
from conformance.packs.table1.robot.standstill import Standstill, glance_rest, watch_rest
from conformance.packs.table1.robot.xml_commands import put_as_xml
from conformance.packs.table1.scenarios.plans import is_refused
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Case

# Speeds that no robot of this contract reaches, even without a declared limit, m/s and rad/s.
_BEYOND_ANY: Final = 1e3
_FARTHER: Final = (1e6, 1e308)
_REACHED: Final = 0.1
# A slow velocity in a direction without a drive, as a share of its range.
_SLOW: Final = 0.1
_AFTER: Final = "refused velocities"


@dataclass(frozen=True)
class Unactuated:
    """A PUT of a velocity in a component that the robot's statement does not list as actuated.

    Attributes:
        path: the resource.
        velocity: the velocity.
        exchange: request and response.
        reached: whether the robot then reached the velocity, and so actuates the component after all.
    """

    path: str
    velocity: Velocity
    exchange: Exchange
    reached: bool


@dataclass(frozen=True)
class RefusedVelocities:
    """All velocities that were sent.

    Attributes:
        beyond: velocities beyond the limits, each with the exchange of its PUT.
        rests: readings after each velocity beyond the limits.
        settled: readings for the settle time, where the statement declares no limits; else None.
        all_actuated: whether the statement says that the robot actuates all components.
        unactuated: velocities in other components.
    """

    beyond: tuple[tuple[Velocity, Exchange], ...] = ()
    rests: tuple[Case, ...] = ()
    settled: Case | None = None
    all_actuated: bool = False
    unactuated: tuple[Unactuated, ...] = ()


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def refused_velocities(robot: Robot, effort: Effort, standstill: Standstill) -> RefusedVelocities:
    """Send velocities beyond the limits and in components that are not actuated, on both resources, at rest."""
    player = _Player(robot, effort)
    with partial_trace(lambda: player.trace):
        player.play()
    again = _Player(robot, effort)
    standstill.attempted("safety/refused-keeps", _AFTER, again.rests, seconds=robot.limits.settle_s)
    return player.trace


@dataclass
class _Player:
    """One play of the scenario."""

    robot: Robot
    effort: Effort
    trace: RefusedVelocities = RefusedVelocities()

    def rests(self) -> tuple[Case, ...]:
        """Play, and return the readings after each velocity beyond the limits."""
        self.play()
        return self.trace.rests

    def play(self) -> None:
        robot = self.robot
        for velocity in self.effort.alternatives(list(_beyond(robot)), 8):
            self._send(velocity)
        put_as_xml(robot, VELOCITY, Velocity(angular_z=_BEYOND_ANY).twist)
        for path, value in ((VELOCITY, _fast(robot).twist), (LINEAR, _fast(robot).linear)):
            for method, target in elsewhere(robot, path):
                self._send_elsewhere(method, target, value)
        if not robot.limits_declared:
            self.trace = replace(self.trace, settled=watch_rest(Drive(robot), _AFTER, robot.limits.settle_s))
        components = [component for component in range(6) if not robot.actuated(component)]
        self.trace = replace(self.trace, all_actuated=not components)
        for component in components:
            self._actuate(component)

    def _send(self, velocity: Velocity) -> None:
        """PUT a velocity beyond the limits, and read the robot.

        A robot that accepts such a velocity commands it at once: one reading is enough, and several if it shows motion.
        """
        robot = self.robot
        for put in (robot.put_velocity, robot.put_linear) if any(velocity[:3]) else (robot.put_velocity,):
            exchange = put(velocity)
            self.trace = replace(self.trace, beyond=(*self.trace.beyond, (velocity, exchange)))
            if not is_refused(exchange):
                robot.put_velocity(STILL)
        self._look(f"a refused velocity, {velocity}")

    def _send_elsewhere(self, method: str, target: str, value: dict[str, Any]) -> None:
        """Send a valid velocity by a method or to a path that the robot must refuse, and read the robot."""
        robot = self.robot
        fields = (("Content-Type", JSON),)
        exchange = robot.rest.send(method, target, headers=fields, body=body_of(value), fresh=True)
        if not is_refused(exchange):
            robot.put_velocity(STILL)  # a vendor's own, or a redirect
            return
        if not self._look(f"{method} {target}, which was refused"):
            robot.put_velocity(STILL)

    def _look(self, after: str) -> bool:
        """Return whether the robot is at rest after a request, and record it."""
        seen = glance_rest(self.robot, after)
        self.trace = replace(self.trace, rests=(*self.trace.rests, seen))
        return seen.holds

    def _actuate(self, component: int) -> None:
        """PUT velocities in a component, until the robot reaches one."""
        robot = self.robot
        for value in (_REACHED, -_REACHED, 1e-3, _BEYOND_ANY):
            velocity = _only(component, value)
            sent = [(VELOCITY, robot.put_velocity(velocity))]
            if any(velocity[:3]):
                sent.append((LINEAR, robot.put_linear(velocity)))
            for path, exchange in sent:
                reached = not is_refused(exchange) and abs(value) == _REACHED and _reaches(robot, velocity)
                one = Unactuated(path, velocity, exchange, reached)
                self.trace = replace(self.trace, unactuated=(*self.trace.unactuated, one))
                if reached:
                    return


def _fast(robot: Robot) -> Velocity:
    return robot.drivable(robot.share_of_limits(0.4, 0.4))


def _only(component: int, value: float) -> Velocity:
    return Velocity(*(value if index == component else 0.0 for index in range(6)))


def _beyond(robot: Robot) -> Iterator[Velocity]:
    """Yield velocities with one component just beyond its limit, far beyond it, and absurd, in both directions."""
    for component in range(6):
        if not robot.actuated(component):
            continue
        least, greatest = robot.limits.range_of(component)
        for times in (1.001, 1.5) if robot.limit_declared(component) else ():
            for sign, limit in ((1, greatest), (-1, least)):
                # A robot without a reverse gear does not drive back slowly either.
                yield _only(component, times * (limit or sign * _SLOW * (greatest - least)))
        for size in (_BEYOND_ANY, *_FARTHER):
            yield from (_only(component, size), _only(component, -size))


def _reaches(robot: Robot, wanted: Velocity) -> bool:
    """Return whether the robot reaches an accepted velocity, which is not near rest; stop it then."""
    reached = not robot.near(wanted, STILL) and Drive(robot).reach(wanted)
    if reached:
        robot.put_velocity(STILL)
    return reached
