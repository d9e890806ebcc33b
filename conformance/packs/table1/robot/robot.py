"""A robot as the checks of its domain see it: read, driven, and judged by the shape of all that it answers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.documents.json_schema import Shape
from conformance.documents.representation import projected
from conformance.observe.clock import WALL_CLOCK, Clock
from conformance.observe.polling import Patience
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.geometry import Pose, pose_of
from conformance.packs.table1.robot.message_shapes import GOAL, ODOMETRY, TWIST, VECTOR3, body_of, read_as
from conformance.packs.table1.statement import said_of
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
    """A geometry_msgs/Twist: m/s and rad/s."""

    linear_x: float = 0.0
    linear_y: float = 0.0
    linear_z: float = 0.0
    angular_x: float = 0.0
    angular_y: float = 0.0
    angular_z: float = 0.0

    @classmethod
    def of(cls, twist: Mapping[str, Any]) -> Velocity:
        """Return the velocity in JSON."""
        return cls(*(float(twist[part][axis]) for part in ("linear", "angular") for axis in "xyz"))

    @property
    def linear(self) -> dict[str, float]:
        """The linear part as JSON."""
        return dict(zip("xyz", self[:3], strict=True))

    @property
    def twist(self) -> dict[str, dict[str, float]]:
        """As JSON."""
        return {"linear": self.linear, "angular": dict(zip("xyz", self[3:], strict=True))}

    def __str__(self) -> str:
        shown = [f"{name.replace('_', '.')} {value:.4g}" for name, value in self._asdict().items() if value]
        return ", ".join(shown) or "zero"


STILL: Final = Velocity()


# Of a sample's noise: one in fifteen thousand is farther off than this, if the noise is normal.
FARTHEST: Final = 4.0
# Odometry is no rarer than that where nothing is declared, Hz.
_SELDOM_HZ: Final = 5.0


def is_near(limits: Limits, measured: Velocity, wanted: Velocity, factor: float = 1.0, samples: float = 1) -> bool:
    """Return whether each component is what was wanted, within ``factor`` times the declared tolerance, and the noise.

    Args:
        limits: of the robot.
        measured: one sample, or the median of several.
        wanted: what it should be.
        factor: how much of the tolerance.
        samples: of how many samples the median is: noise counts the less, the more there are.
    """
    noise = limits.noise
    off = FARTHEST / math.sqrt(samples)
    linear = factor * limits.tolerance_linear_m_s + off * noise.linear_m_s
    angular = factor * limits.tolerance_angular_rad_s + off * noise.angular_rad_s
    return all(
        abs(one - other) <= factor * limits.tolerance * abs(other) + room
        for one, other, room in zip(measured, wanted, (linear,) * 3 + (angular,) * 3, strict=True)
    )


@dataclass(frozen=True)
class Odometry:
    """One reading of the odometry.

    Attributes:
        sent, received: when it was requested and received, s of the monotonic clock.
        stamp: the robot's own, s.
        pose: in the odometry frame.
        velocity: in the robot's frame.
        exchange: the evidence.
    """

    sent: float
    received: float
    stamp: float
    pose: Pose
    velocity: Velocity
    exchange: Exchange


class Robot:
    """One robot, over REST.

    Attributes:
        clock: by which it is watched.
    """

    def __init__(self, api: RestInterface, clock: Clock = WALL_CLOCK) -> None:
        self.rest, self.clock = api.client, clock
        self._contract = api.run.contract
        self.judge = api.run.judge
        self.statement = said_of(api.run)
        self.limits = self.statement.limits
        # A ceiling on the rate of requests makes a robot as slow as one that answers slowly.
        self.usual_s = max(api.run.effort.usual_ms / 1000, 1 / (api.client.connection.request_rate or 1e9))
        # How long what must not happen is watched for, in relation to standard effort.
        self.watchfulness = 0.5 if api.run.effort.name == "quick" else 1.0

    @property
    def limits_declared(self) -> bool:
        """Whether the statement says how fast the robot can be, so that beyond it is known."""
        return self.limits.linear_declared and self.limits.angular_declared

    @property
    def settle_s(self) -> float:
        """How long to wait before a velocity that is not reached is held against the robot, s.

        A quarter more than declared and a quarter of a second, for a loaded machine and a network between.
        """
        return 1.25 * self.limits.settle_s + 0.25 + 4 * self.usual_s

    @property
    def sample_s(self) -> float:
        """How long the robot has one sample of its odometry, and one interface may be behind another, at most, s."""
        return 1 / (self.limits.odometry_hz or _SELDOM_HZ)

    def patience(self, seconds: float) -> Patience:
        """Return a wait of so many seconds, in which delays of the responses do not count."""
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
        """Read a message, without members that a robot adds; None where the response is something else."""
        exchange = self.get(path)
        value, problem = read_as(exchange.response, shape)
        return (None if problem else projected(value, shape.schema)), exchange

    def put(self, path: str, value: Mapping[str, Any]) -> Exchange:
        """Send a PUT of JSON that is valid by the contract's schema.

        Raises:
            HarnessError: it does not.
        """
        body = body_of(value)
        require_valid(self._contract, "PUT", path, JSON, body)
        return self.rest.send("PUT", path, headers=JSON_BODY, body=body)

    def odometry(self) -> Odometry | None:
        """Return the odometry, or None where it cannot be read (which the observers have judged)."""
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
        """Return the measured velocity, or None where it cannot be read."""
        twist, exchange = self.read(VELOCITY, TWIST)
        return (None if twist is None else Velocity.of(twist)), exchange

    def linear(self) -> tuple[Velocity | None, Exchange]:
        """Return the linear part of the measured velocity, as a velocity that does not turn."""
        vector, exchange = self.read(LINEAR, VECTOR3)
        return (None if vector is None else Velocity(*(float(vector[axis]) for axis in "xyz"))), exchange

    def put_velocity(self, velocity: Velocity) -> Exchange:
        """Command a velocity."""
        return self.put(VELOCITY, velocity.twist)

    def put_linear(self, velocity: Velocity) -> Exchange:
        """Command the linear part of a velocity."""
        return self.put(LINEAR, velocity.linear)

    def goal(self) -> tuple[Any, Exchange]:
        """Return the active goal as JSON, or None."""
        exchange = self.get(GOAL_PATH)
        return read_as(exchange.response, GOAL)[0], exchange

    def delete_goal(self, *headers: tuple[str, str]) -> Exchange:
        """Cancel the goal."""
        return self.rest.send("DELETE", GOAL_PATH, headers=headers)

    def map_pose(self) -> Pose | None:
        """Return where the robot is in the frame of goals and plans, by the statement's transform."""
        odometry = self.odometry()
        return self.in_map(odometry.pose) if odometry else None

    def in_map(self, pose: Pose) -> Pose:
        """Return a pose of the odometry in the frame of goals and plans."""
        return pose.seen_from(Pose(*self.statement.motion.odom_to_map))

    def in_odometry(self, pose: Pose) -> Pose:
        """Return a pose in the frame of goals and plans, in the odometry's frame."""
        return pose.seen_in(Pose(*self.statement.motion.odom_to_map))

    def in_arena(self, pose: Pose) -> bool:
        """Return whether the statement lets the robot be driven to a pose in the frame of goals."""
        arena = self.statement.motion.arena
        return arena is None or (arena[0] <= pose.x <= arena[2] and arena[1] <= pose.y <= arena[3])

    def near(self, measured: Velocity, wanted: Velocity, factor: float = 1.0) -> bool:
        """Return whether each component is what was wanted, within ``factor`` times the tolerance."""
        return is_near(self.limits, measured, wanted, factor)

    def share_of_limits(self, linear: float, angular: float) -> Velocity:
        """Return a velocity ahead and turning, by shares of the limits; zero in what the robot cannot actuate."""
        return Velocity(
            linear_x=linear * self.limits.linear_m_s if self.actuated(0) else 0.0,
            angular_z=angular * self.limits.angular_rad_s if self.actuated(5) else 0.0,
        )

    def limit_of(self, component: int) -> float:
        """Return the limit of a component by its place in Velocity, declared or not, m/s or rad/s."""
        return self.limits.linear_m_s if component < len("xyz") else self.limits.angular_rad_s

    def limit_declared(self, component: int) -> bool:
        """Return whether the statement names the limit of a component."""
        return self.limits.linear_declared if component < len("xyz") else self.limits.angular_declared

    def actuated(self, component: int) -> bool:
        """Return whether the statement says that the robot can actuate a component."""
        return Velocity._fields[component].replace("_", ".") in self.statement.motion.actuated
