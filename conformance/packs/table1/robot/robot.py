"""The robot as the paper pack's checks use it: typed reads and writes over REST, with units and frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from conformance.api.rest.calls import JSON, XML
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.documents.json_shape import Shape
from conformance.documents.representation import UnreadableError, local_name, parse_xml, projected
from conformance.documents.writing import xml_bytes
from conformance.measures.samples import FARTHEST
from conformance.observe.clock import WALL_CLOCK, Clock, Patience
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.geometry import Pose, pose_of
from conformance.packs.table1.robot.message_shapes import GOAL, ODOMETRY, TWIST, VECTOR3, body_of, read_as
from conformance.packs.table1.statement import Motion, said_of
from conformance.transport.exchange import Exchange

POSE: Final = "/robot/pose/"
VELOCITY: Final = "/robot/velocity/"
LINEAR: Final = "/robot/velocity/linear/"
SENSORS: Final = "/robot/sensors/"
SERVICES: Final = "/robot/navigation/services/"
GOAL_PATH: Final = "/robot/navigation/action/goal/"
PLAN: Final = "/robot/navigation/service/plan"
DELIVERIES: Final = "/robot/app/delivery/"
ACCEPT_JSON: Final = (("Accept", "application/json"),)
JSON_BODY: Final = (("Content-Type", "application/json"), ("Accept", "application/json"))


class Velocity(NamedTuple):
    """A velocity (geometry_msgs/Twist): m/s and rad/s."""

    linear_x: float = 0.0
    linear_y: float = 0.0
    linear_z: float = 0.0
    angular_x: float = 0.0
    angular_y: float = 0.0
    angular_z: float = 0.0

    @classmethod
    def of(cls, twist: Mapping[str, Any]) -> Velocity:
        """Return the velocity in a Twist in JSON."""
        return cls(*(float(twist[part][axis]) for part in ("linear", "angular") for axis in "xyz"))

    @property
    def linear(self) -> dict[str, float]:
        """Return the linear part as a JSON object."""
        return dict(zip("xyz", self[:3], strict=True))

    @property
    def twist(self) -> dict[str, dict[str, float]]:
        """Return the velocity as a Twist in JSON."""
        return {"linear": self.linear, "angular": dict(zip("xyz", self[3:], strict=True))}

    def __str__(self) -> str:
        shown = [f"{name.replace('_', '.')} {value:.4g}" for name, value in self._asdict().items() if value]
        return ", ".join(shown) or "zero"


STILL: Final = Velocity()


# Lowest rate of odometry that is assumed where none is declared, Hz.
_SELDOM_HZ: Final = 5.0


def is_near(limits: Limits, measured: Velocity, wanted: Velocity, factor: float = 1.0, samples: float = 1) -> bool:
    """Return whether each component is the wanted one, within ``factor`` times the declared tolerance plus noise.

    Args:
        limits: the robot's limits, tolerance and noise.
        measured: one sample, or the median of several.
        wanted: the wanted velocity.
        factor: multiple of the tolerance.
        samples: number of samples in the median; the more, the smaller is the noise.
    """
    linear, angular = (limits.rest(part, FARTHEST / math.sqrt(samples), factor) for part in (AHEAD, ABOUT))
    return all(
        abs(one - other) <= factor * limits.tolerance * abs(other) + room
        for one, other, room in zip(measured, wanted, (linear,) * 3 + (angular,) * 3, strict=True)
    )


@dataclass(frozen=True)
class Odometry:
    """One reading of the odometry.

    Attributes:
        sent, received: times of request and response, s of the monotonic clock.
        stamp: the robot's timestamp, s.
        pose: the pose in the odometry frame.
        velocity: the velocity in the robot's frame.
        exchange: the GET's request and response.
    """

    sent: float
    received: float
    stamp: float
    pose: Pose
    velocity: Velocity
    exchange: Exchange


class Robot:
    """One robot over REST.

    Attributes:
        clock: the run's clock, used for every wait.
        may_move: whether the run has the permission to move it.
    """

    def __init__(self, api: RestInterface, clock: Clock = WALL_CLOCK) -> None:
        self.rest, self.clock = api.client, clock
        self.may_move = api.run.allow_motion
        self._contract = api.run.contract
        self.statement = said_of(api.run)
        self.limits = self.statement.limits
        # A limit on the request rate slows the suite as much as a slow robot does.
        self.usual_s = max(api.run.effort.usual_ms / 1000, 1 / (api.client.connection.request_rate or 1e9))
        # Factor of the time for which the suite watches that something does not happen.
        self.watchfulness = 0.5 if api.run.effort.name == "quick" else 1.0

    @property
    def settle_s(self) -> float:
        """Return how long the robot has to reach a velocity before a miss counts as a failure, s.

        The declared time, a quarter more, and 0.25 s for a loaded machine and the network.
        """
        return 1.25 * self.limits.settle_s + 0.25 + 4 * self.usual_s

    @property
    def sample_s(self) -> float:
        """Return the longest time between odometry samples, by which two interfaces may differ, s."""
        return 1 / (self.limits.odometry_hz or _SELDOM_HZ)

    def is_late(self, exchange: Exchange) -> bool:
        """Return whether a response took so much longer than usual that the request may have been late as well."""
        return self.rest.connection.pace.is_late(exchange.response.elapsed_ms / 1000)

    def arrived_by(self, exchange: Exchange, answered: float) -> float:
        """Return when a request must have arrived: a usual response time after it was sent, s of the run's clock.

        Args:
            exchange: the request and its response.
            answered: when the response came, s of the run's clock. The request did not arrive later than that.
        """
        return answered - max(0.0, exchange.response.elapsed_ms / 1000 - self.usual_s)

    def patience(self, seconds: float) -> Patience:
        """Return a wait of ``seconds``, not counting the time that the robot's responses take."""
        return Patience(self.rest.connection.pace, seconds, self.clock)

    def get(self, path: str) -> Exchange:
        """Send a GET for JSON.

        Raises:
            HarnessError: the parameters are not valid by the contract.
        """
        if "?" in path:
            require_valid(self._contract, "GET", path)
        return self.rest.send("GET", path, headers=ACCEPT_JSON)

    def read(self, path: str, shape: Shape) -> tuple[Any, Exchange]:
        """GET a message and remove the fields that the robot adds to its schema; None where the response is invalid."""
        exchange = self.get(path)
        value, problem = read_as(exchange.response, shape)
        return (None if problem else projected(value, shape.schema)), exchange

    def put(self, path: str, value: Mapping[str, Any], *, fresh: bool = False) -> Exchange:
        """PUT JSON that is valid by the contract's schema; ``fresh``: on a connection that is closed afterwards.

        Raises:
            HarnessError: the value is not valid by the schema.
        """
        body = body_of(value)
        require_valid(self._contract, "PUT", path, JSON, body)
        return self.rest.send("PUT", path, headers=JSON_BODY, body=body, fresh=fresh)

    def odometry(self) -> Odometry | None:
        """GET the odometry; None where the response is invalid (the checkers have judged it)."""
        sent = self.clock.now()
        message, exchange = self.read(POSE, ODOMETRY)
        if message is None:
            return None
        stamp = message["header"]["stamp"]
        return Odometry(
            sent,
            self.clock.now(),
            stamp["sec"] + stamp["nanosec"] * 1e-9,
            pose_of(message["pose"]["pose"]),
            Velocity.of(message["twist"]["twist"]),
            exchange,
        )

    def velocity(self) -> tuple[Velocity | None, Exchange]:
        """GET the measured velocity; None where the response is invalid."""
        twist, exchange = self.read(VELOCITY, TWIST)
        return (None if twist is None else Velocity.of(twist)), exchange

    def linear(self) -> tuple[Velocity | None, Exchange]:
        """GET the linear part of the measured velocity, as a velocity whose angular part is zero."""
        vector, exchange = self.read(LINEAR, VECTOR3)
        return (None if vector is None else Velocity(*(float(vector[axis]) for axis in "xyz"))), exchange

    def put_velocity(self, velocity: Velocity, *, fresh: bool = False) -> Exchange:
        """PUT a velocity; ``fresh``: on a connection that is closed afterwards."""
        return self.put(VELOCITY, velocity.twist, fresh=fresh)

    def put_linear(self, velocity: Velocity) -> Exchange:
        """PUT the linear part of a velocity."""
        return self.put(LINEAR, velocity.linear)

    def goal(self) -> tuple[Any, Exchange]:
        """GET the active goal as JSON, or None."""
        exchange = self.get(GOAL_PATH)
        return read_as(exchange.response, GOAL)[0], exchange

    def delete_goal(self, *headers: tuple[str, str]) -> Exchange:
        """DELETE the goal, which cancels it."""
        return self.rest.send("DELETE", GOAL_PATH, headers=headers)

    def map_pose(self) -> Pose | None:
        """Return the robot's pose in the frame of goals, from the odometry and the statement's transform."""
        odometry = self.odometry()
        return self.in_map(odometry.pose) if odometry else None

    def in_map(self, pose: Pose) -> Pose:
        """Transform a pose from the odometry frame to the frame of goals."""
        return pose.seen_from(Pose(*self.statement.motion.odom_to_map))

    def in_odometry(self, pose: Pose) -> Pose:
        """Transform a pose from the frame of goals and plans to the odometry frame."""
        return pose.seen_in(Pose(*self.statement.motion.odom_to_map))

    def in_arena(self, pose: Pose) -> bool:
        """Return whether a pose in the frame of goals lies in the area where the statement allows driving."""
        arena = self.statement.motion.arena
        return arena is None or (arena[0] <= pose.x <= arena[2] and arena[1] <= pose.y <= arena[3])

    def near(self, measured: Velocity, wanted: Velocity, factor: float = 1.0) -> bool:
        """Return whether each component is the wanted one, within ``factor`` times the tolerance."""
        return is_near(self.limits, measured, wanted, factor)

    def share_of_limits(self, linear: float, angular: float) -> Velocity:
        """Return a velocity of given shares of the limits, as far as the robot can drive it."""
        return self.drivable(Velocity(linear_x=self.share(AHEAD, linear), angular_z=self.share(ABOUT, angular)))

    def share(self, component: int, share: float) -> float:
        """Return a share of a component's limit, or of the opposite limit if the robot has none in that direction."""
        least, greatest = self.limits.range_of(component)
        return share * ((greatest or -least) if share > 0 else (-least or greatest))

    def drivable(self, velocity: Velocity) -> Velocity:
        """Return this velocity, or the most similar one that the statement lets the robot drive."""
        return Velocity(*drivable(self.limits, self.statement.motion, velocity))

    def only(self, component: int, value: float) -> Velocity:
        """Return a velocity in one component, m/s or rad/s, with the other components it needs to drive."""
        return self.drivable(Velocity(*(value if index == component else 0.0 for index in range(6))))

    def limit_declared(self, component: int) -> bool:
        """Return whether the statement declares the limit of a component."""
        return self.limits.linear_declared if component < len("xyz") else self.limits.angular_declared

    def can_move(self, component: int) -> bool:
        """Return whether the statement declares that the robot can move in a component."""
        return can_move(self.statement.motion, component)

    @property
    def reverses(self) -> bool:
        """Return whether the robot can drive back."""
        return self.limits.range_of(AHEAD)[0] < 0


#: Indexes into Velocity of the components that a wheeled robot has: ahead, and about the vertical axis.
AHEAD, ABOUT = 0, 5
# Components of a velocity, the one that needs least room first.
_BY_ROOM: Final = (ABOUT, AHEAD, 1, 2, 3, 4)
# A circle this much wider than the narrowest is driveable despite rounding.
_WIDER: Final = 1.02


def drivable(limits: Limits, motion: Motion, velocity: Sequence[float]) -> tuple[float, ...]:
    """Return the velocity (six components) that a robot can drive instead of one that it may be unable to drive.

    A component that is not actuated becomes zero. A robot without a reverse gear drives ahead instead. A robot that
    cannot turn on the spot turns in its narrowest circle. Where the speed of the wheels limits a curve, both parts
    become smaller.
    """
    fitted = [_within(limits, motion, component, value) for component, value in enumerate(velocity)]
    radius, separation = motion.min_radius_m, motion.wheel_separation_m
    if radius and fitted[ABOUT] and abs(fitted[AHEAD]) < radius * abs(fitted[ABOUT]):
        least = math.copysign(_WIDER * radius * abs(fitted[ABOUT]), fitted[AHEAD] or 1.0)
        fitted[AHEAD] = _within(limits, motion, AHEAD, least)
        fitted[ABOUT] = turn_beside(limits, motion, fitted[AHEAD], fitted[ABOUT])
    if separation and fitted[AHEAD] and fitted[ABOUT]:
        wheel = abs(fitted[AHEAD]) + abs(fitted[ABOUT]) * separation / 2
        share = min(1.0, _wheels(limits) / wheel)
        fitted[AHEAD], fitted[ABOUT] = share * fitted[AHEAD], share * fitted[ABOUT]
    return tuple(fitted)


def turn_beside(limits: Limits, motion: Motion, ahead: float, turn: float) -> float:
    """Return the turning rate of ``turn`` or less, rad/s, that a robot can have while it drives at ``ahead``, m/s."""
    most = abs(turn)
    if motion.min_radius_m:
        most = min(most, abs(ahead) / (_WIDER * motion.min_radius_m))
    if motion.wheel_separation_m:
        most = min(most, max(0.0, _wheels(limits) - abs(ahead)) * 2 / motion.wheel_separation_m)
    return math.copysign(most, turn)


def _wheels(limits: Limits) -> float:
    """Return the greatest speed of a wheel, m/s."""
    return max(map(abs, limits.range_of(AHEAD)))


def can_move(motion: Motion, component: int) -> bool:
    """Return whether a robot can move in a component (index into Velocity)."""
    part, axis = divmod(component, len("xyz"))
    return f"{('linear', 'angular')[part]}.{'xyz'[axis]}" in motion.actuated


def handiest(motion: Motion) -> int:
    """Return the component in which a robot can move with the least room."""
    return next((component for component in _BY_ROOM if can_move(motion, component)), ABOUT)


def _within(limits: Limits, motion: Motion, component: int, value: float) -> float:
    """Return a velocity component clipped to its range; reversed if the robot moves only the other way."""
    if not can_move(motion, component):
        return 0.0
    least, greatest = limits.range_of(component)
    if (value < 0 and not least) or (value > 0 and not greatest):
        value = -value
    return max(least, min(greatest, value))


def put_as_xml(
    robot: Robot,
    path: str,
    value: Mapping[str, Any],
    *,
    accept: str = JSON,
    before: Callable[[], object] = lambda: None,
) -> Exchange | None:
    """PUT a value as XML; return None if the robot sends no XML for that resource.

    Args:
        robot: the robot.
        path: path of the resource.
        value: the value, as JSON would have it.
        accept: media type of the response.
        before: called just before the PUT.

    Raises:
        NoAnswerError: there is no response.
    """
    answer = robot.rest.send("GET", path, headers=(("Accept", XML),)).response
    if not answer.ok or answer.media_type != XML:
        return None
    try:
        form = parse_xml(answer.body)
    except UnreadableError:
        return None
    body = xml_bytes(value, local_name(form), form)
    before()
    return robot.rest.send("PUT", path, headers=(("Content-Type", XML), ("Accept", accept)), body=body)
