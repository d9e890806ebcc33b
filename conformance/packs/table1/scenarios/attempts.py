"""Requests that must not move a robot at rest: refused velocities, cut requests, 406, a cancelled goal."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from conformance.api.rest.body_mutations import near_misses
from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.documents.openapi import operations_of
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import choose_goals, goal_body, put_goal
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import (
    GOAL_PATH,
    JSON_BODY,
    LINEAR,
    STILL,
    VELOCITY,
    Robot,
    Velocity,
    put_as_xml,
)
from conformance.packs.table1.robot.stopping import await_rest
from conformance.packs.table1.scenarios.goal_life import await_motion, cancel, slow_turn
from conformance.packs.table1.scenarios.not_acceptable import put_unacceptable, turned_goal
from conformance.packs.table1.scenarios.plans import is_refused
from conformance.scenarios.motion.attempts import send_in_parts, tried_at_rest
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.trace import Quiet, Tried
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange, Outgoing


def invalid_bodies(api: RestInterface, path: str, valid: dict[str, Any], number: str) -> list[tuple[str, str, bytes]]:
    """Return bodies that would move the robot if it accepted them, as (what is wrong, media type, body).

    Args:
        api: the robot's REST interface.
        path: the resource.
        valid: a valid JSON object.
        number: where in the object a number is, as names with dots between them.
    """
    put = next(item for item in operations_of(api.run.contract) if (item.method, item.template) == ("PUT", path))
    made = near_misses(valid, put.bodies[JSON].schema, tuple(number.split(".")))
    return [*((item.what, JSON, item.made) for item in made), ("text/plain", "text/plain", body_of(valid))]


def put_body(robot: Robot, path: str, media_type: str, body: bytes) -> Exchange:
    """PUT a body of a media type, and return the exchange."""
    return robot.rest.send("PUT", path, headers=(("Content-Type", media_type),), body=body)


def elsewhere(robot: Robot, path: str) -> Iterator[tuple[str, str]]:
    """Yield methods that a resource does not have, and PUT without its slash (contract.md#addresses), with the path."""
    allowed = robot.rest.send("OPTIONS", path).response.header("Allow") or ""
    yield from ((method, path) for method in ("POST", "PATCH") if method not in allowed)
    yield "PUT", path.rstrip("/")


#: Marks a goal in the list of things that a robot at rest must not have.
GOAL: Final = "an active goal"
# Speeds that no robot of this contract reaches, even without a declared limit, m/s and rad/s.
_BEYOND_ANY: Final = 1e3
_FARTHER: Final = (1e6, 1e308)
_REACHED: Final = 0.1
# Slow velocity in a direction that the robot cannot drive in, as a share of its range.
_SLOW: Final = 0.1
_STAYS_S: Final = 1.3  # how long the robot must stay in place after a cancelled goal, s
_AWAY_M: Final = 1.0  # distance of a goal, m


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def attempts(api: RestInterface, robot: Robot, mapped_robot: MappedDevice) -> Quiet:
    """Send requests to a robot at rest that must not move it, and watch its position and goal."""
    made = _Attempts(api, robot, mapped_robot)
    several = [made.try_cancelled, made.not_acceptable, made.incomplete, made.beyond, made.elsewhere, made.invalid]
    several += [made.try_unactuated]
    watched_s = max(robot.limits.settle_s, _STAYS_S * robot.watchfulness)
    return tried_at_rest(mapped_robot, several, made.settle, watched_s, made.goal)


@dataclass(frozen=True)
class _Attempts:
    api: RestInterface
    robot: Robot
    mapped: MappedDevice

    def settle(self) -> None:
        """Bring the robot to rest, after waiting for earlier commands to begin."""
        await_rest(self.api, settled=True)

    def goal(self) -> str:
        """Return the robot's goal for a message; empty if it has none."""
        return "" if self.robot.goal()[0] is None else GOAL

    def try_cancelled(self) -> Iterator[Tried]:
        """Command a velocity, put a goal in its place, and cancel that."""
        robot = self.robot
        robot.put_velocity(slow_turn(robot))
        try:
            goal = self._goal(choose_goals(robot, _AWAY_M, 1)[0])
        except NoOccasionError:
            return
        if put_goal(robot, goal).response.ok:
            await_motion(robot)
            yield Tried("cancelled", "the goal was cancelled", cancel(robot).exchange)

    def not_acceptable(self) -> Iterator[Tried]:
        """PUT velocities and a goal with an Accept header that excludes all formats; one may take them."""
        robot, here = self.robot, self.robot.map_pose()
        fast = robot.share_of_limits(0.6, 0.4)
        puts: list[tuple[str, dict[str, Any]]] = [(VELOCITY, fast.twist), (LINEAR, fast.linear)]
        for path, value in [*puts, *([(GOAL_PATH, turned_goal(robot, here))] if here else [])]:
            exchange = put_unacceptable(robot, path, value)
            yield from self._one("not acceptable", f"PUT {path} that was answered 406", exchange)

    def _one(self, kind: str, what: str, exchange: Exchange, *, judged: bool = False) -> Iterator[Tried]:
        """Yield an attempt that was refused, or is ``judged`` in any case; stop a robot that took it."""
        if not is_refused(exchange):
            self.settle()
        if judged or is_refused(exchange):
            yield Tried(kind, what, exchange)

    def incomplete(self) -> Iterator[Tried]:
        """Begin requests that would move the robot, ahead or back, and close their connections before they end."""
        robot, here = self.robot, self.robot.map_pose() or Pose(0.0, 0.0, 0.0)
        for sign in (1, -1):
            fast, goal = robot.share_of_limits(0.3 * sign, 0.5 * sign), self._goal(here.ahead(sign * _AWAY_M))
            for path, value in ((VELOCITY, fast.twist), (LINEAR, fast.linear), (GOAL_PATH, goal)):
                yield from send_in_parts(self.mapped, Outgoing("PUT", path, JSON_BODY, body_of(value)), f"PUT {path}")

    def beyond(self) -> Iterator[Tried]:
        """PUT velocities beyond the limits, on each resource that has the component."""
        robot = self.robot
        for velocity in self.api.run.effort.alternatives(list(_beyond(robot)), 8):
            for put in (robot.put_velocity, robot.put_linear) if any(velocity[:3]) else (robot.put_velocity,):
                yield from self._one("beyond", f"a velocity beyond the limits, {velocity}", put(velocity), judged=True)
        put_as_xml(robot, VELOCITY, Velocity(angular_z=_BEYOND_ANY).twist)

    def elsewhere(self) -> Iterator[Tried]:
        """Send a valid velocity by a method or to a path that the robot must refuse; some are a vendor's own."""
        fast = self.robot.share_of_limits(0.4, 0.4)
        for path, value in ((VELOCITY, fast.twist), (LINEAR, fast.linear)):
            for method, target in elsewhere(self.robot, path):
                fields, body = (("Content-Type", JSON),), body_of(value)
                exchange = self.robot.rest.send(method, target, headers=fields, body=body, fresh=True)
                yield from self._one("invalid", f"{method} {target}, which was refused", exchange)

    def invalid(self) -> Iterator[Tried]:
        """PUT invalid velocities, which would move the robot if it accepted them."""
        fast, effort = self.robot.share_of_limits(0.4, 0.4), self.api.run.effort
        for path, valid, number in ((VELOCITY, fast.twist, "linear.x"), (LINEAR, fast.linear, "x")):
            for what, media_type, body in effort.alternatives(invalid_bodies(self.api, path, valid, number), 8):
                yield Tried("invalid", f"PUT {path} with {what}", put_body(self.robot, path, media_type, body))

    def try_unactuated(self) -> Iterator[Tried]:
        """PUT velocities in components that the statement does not list, until the robot reaches one of each."""
        for component in (component for component in range(len(STILL)) if not self.robot.can_move(component)):
            for value in (_REACHED, -_REACHED, 1e-3, _BEYOND_ANY):
                made = list(self._actuate(component, value))
                yield from made
                if made[-1].kind == "driven":
                    break

    def _actuate(self, component: int, value: float) -> Iterator[Tried]:
        robot, velocity = self.robot, _only(component, value)
        for put in (robot.put_velocity, robot.put_linear) if any(velocity[:3]) else (robot.put_velocity,):
            exchange = put(velocity)
            drives = not is_refused(exchange) and abs(value) == _REACHED and not robot.near(velocity, STILL)
            reached = drives and Drive(robot).reach(velocity)
            what = f"{velocity}, which the robot cannot actuate"
            yield from self._one("driven" if reached else "unactuated", what, exchange, judged=True)
            if reached:
                return

    def _goal(self, pose: Pose) -> dict[str, Any]:
        return goal_body(pose, self.robot.statement.motion.frame, "an attempt")


def _only(component: int, value: float) -> Velocity:
    return Velocity(*(value if index == component else 0.0 for index in range(6)))


def _beyond(robot: Robot) -> Iterator[Velocity]:
    """Yield velocities with one component just beyond its limit, far beyond it, and absurd, in both directions."""
    for component in range(6):
        if not robot.can_move(component):
            continue
        least, greatest = robot.limits.range_of(component)
        for times in (1.001, 1.5) if robot.limit_declared(component) else ():
            for sign, limit in ((1, greatest), (-1, least)):
                # A robot without a reverse gear must refuse a slow backward velocity too.
                yield _only(component, times * (limit or sign * _SLOW * (greatest - least)))
        for size in (_BEYOND_ANY, *_FARTHER):
            yield from (_only(component, size), _only(component, -size))
