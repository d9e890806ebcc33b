"""A differential-drive robot as arithmetic: each reading computes the state from the time that has passed."""

import math
import threading
import time
import uuid
from dataclasses import dataclass, field
from typing import Any

TICK_S = 0.01
_ARRIVED_M = 0.03
_ARRIVED_RAD = 0.03
_STEP_M = 0.1
_KEPT = 200
_LATE = 2_000


@dataclass(frozen=True)
class Build:
    """The abilities of one robot.

    Attributes:
        linear_m_s: highest commanded speed that the robot accepts, m/s; angular_rad_s likewise, rad/s.
        cruise_m_s: speed on the way to a goal, m/s; turn_rad_s likewise, rad/s.
        acceleration: m/s^2; spin: rad/s^2.
        hold_s: how long a command holds, s.
        bounds: x_min, y_min, x_max, y_max of its map, m.
        start: x, y, yaw at the beginning, m and rad.
        odom: x, y, yaw of the odometry's frame in the map's, m and rad.
    """

    linear_m_s: float
    angular_rad_s: float
    cruise_m_s: float
    turn_rad_s: float
    acceleration: float
    spin: float
    hold_s: float
    bounds: tuple[float, float, float, float]
    start: tuple[float, float, float]
    odom: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass
class Goal:
    """One goal: where to, and since when (s since the epoch)."""

    id: str
    pose: dict[str, Any]
    frame: str
    stamp: float
    x: float
    y: float
    yaw: float
    reachable: bool


@dataclass
class Delivery:
    """An accepted delivery, with the time and the interface of its request."""

    request: dict[str, float | int]
    accepted: float
    interface: str


@dataclass
class _State:
    x: float
    y: float
    yaw: float
    v: float = 0.0
    w: float = 0.0


class BusyError(Exception):
    """The robot drives to a goal and takes no velocity."""


class ConflictError(Exception):
    """The active goal has this id, but another pose."""


class NoPlanError(Exception):
    """Raised when there is no path to a place; the message says why."""


@dataclass
class Body:
    """The state of a robot; every method may be called from any thread.

    Args:
        build: the robot's abilities.
        yields: whether a velocity ends the active goal (otherwise a velocity is rejected with BusyError).
    """

    build: Build
    yields: bool = False
    deliveries: list[Delivery] = field(default_factory=list)
    goal: Goal | None = None
    further_axes = 0.0  # greatest velocity that it accepts along axes without a motor, m/s and rad/s

    def __post_init__(self) -> None:
        self._lock = threading.RLock()
        self._state = _State(*self.build.start)
        self._tick = int(time.time() / TICK_S)
        self._command = (0.0, 0.0)
        self._until = 0

    def odometry(self) -> dict[str, Any]:
        """Return the pose and velocity as nav_msgs/Odometry."""
        with self._lock:
            self._advance()
            state = self._state
            return {
                "header": {"stamp": stamp(self._tick * TICK_S), "frame_id": "odom"},
                "child_frame_id": "base_link",
                "pose": {"pose": pose(*self.in_odom(state.x, state.y, state.yaw)), "covariance": _covariance(0.001)},
                "twist": {"twist": twist(state.v, state.w), "covariance": _covariance(0.0001)},
            }

    def velocity(self) -> dict[str, Any]:
        """Return the measured velocity as geometry_msgs/Twist."""
        with self._lock:
            self._advance()
            return twist(self._state.v, self._state.w)

    def drive(self, v: float, w: float | None) -> float:
        """Command a velocity; without ``w`` the last commanded turning rate is kept. Return ``w``.

        Raises:
            BusyError: a goal is active, and this robot does not yield.
        """
        with self._lock:
            self._advance()
            if self.goal is not None:
                if not self.yields:
                    raise BusyError
                self.goal = None
            if w is None:
                w = self._command[1] if self._until > self._tick else 0.0
            self._command = (v, w)
            self._until = self._tick + round(self.build.hold_s / TICK_S)
            return w

    def send(self, id_: str | None, target: dict[str, Any], frame: str) -> tuple[Goal, bool]:
        """Accept a goal. Return the goal, and whether it is new.

        Raises:
            ConflictError: another pose has the active goal's id.
        """
        with self._lock:
            self._advance()
            if self.goal is not None and id_ == self.goal.id:
                if (self.goal.pose, self.goal.frame) != (target, frame):
                    raise ConflictError
                return self.goal, False
            place = (target["position"]["x"], target["position"]["y"], yaw_of(target["orientation"]))
            x, y, yaw = self.on_map(*place) if frame == "odom" else place
            goal = Goal(id_ or uuid.uuid4().hex, target, frame, time.time(), x, y, yaw, self.knows(x, y))
            self.goal = goal
            self._command, self._until = (0.0, 0.0), 0
            return goal, True

    def current(self) -> Goal | None:
        """Return the active goal, or None."""
        with self._lock:
            self._advance()
            return self.goal

    def cancel(self) -> bool:
        """Cancel the active goal. Return whether there was one."""
        with self._lock:
            self._advance()
            had = self.goal is not None
            self.goal = None
            return had

    def in_odom(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Return a pose of the map's frame in the odometry's frame, m and rad."""
        away_x, away_y, turned = self.build.odom
        x, y = x - away_x, y - away_y
        cos, sin = math.cos(turned), math.sin(turned)
        return cos * x + sin * y, cos * y - sin * x, wrapped(yaw - turned)

    def on_map(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Return a pose of the odometry's frame in the map's frame, m and rad."""
        away_x, away_y, turned = self.build.odom
        cos, sin = math.cos(turned), math.sin(turned)
        return away_x + cos * x - sin * y, away_y + sin * x + cos * y, wrapped(yaw + turned)

    def knows(self, x: float, y: float) -> bool:
        """Return whether a place is on the map."""
        low_x, low_y, high_x, high_y = self.build.bounds
        return low_x <= x <= high_x and low_y <= y <= high_y

    def path(self, start: tuple[float, float, float] | None, x: float, y: float, yaw: float) -> list[dict[str, Any]]:
        """Return the poses (geometry_msgs/Pose) of a straight line, at most 0.1 m apart.

        Raises:
            NoPlanError: a place is not on the map.
        """
        if start is None:
            with self._lock:
                self._advance()
                start = (self._state.x, self._state.y, self._state.yaw)
        for name, there in (("x", (x, y)), ("start_x", start[:2])):
            if not self.knows(*there):
                raise NoPlanError(f"{name}: no plan, for {there[0]!r}, {there[1]!r} is not on the map")
        length = math.hypot(x - start[0], y - start[1])
        steps = max(1, math.ceil(length / _STEP_M))
        heading = math.atan2(y - start[1], x - start[0]) if length else yaw
        poses = [pose(start[0], start[1], start[2])]
        for step in range(1, steps):
            part = step / steps
            poses.append(pose(start[0] + part * (x - start[0]), start[1] + part * (y - start[1]), heading))
        return [*poses, pose(x, y, yaw)]

    def deliver(self, interface: str, **request: float) -> None:
        """Accept a delivery: message_code, and x and y of depot, destination and source."""
        with self._lock:
            self.deliveries.insert(0, Delivery(request, time.time(), interface))
            del self.deliveries[_KEPT:]

    def _advance(self) -> None:
        now = int(time.time() / TICK_S)
        state = self._state
        while self._tick < now:
            still = not state.v and not state.w and self.goal is None and self._until <= self._tick
            if still or now - self._tick > _LATE:
                self._tick = now if still else now - _LATE
                continue
            self._tick += 1
            v, w = self._aim()
            state.v += _bound(v - state.v, self.build.acceleration * TICK_S)
            state.w += _bound(w - state.w, self.build.spin * TICK_S)
            middle = state.yaw + state.w * TICK_S / 2
            state.x += state.v * math.cos(middle) * TICK_S
            state.y += state.v * math.sin(middle) * TICK_S
            state.yaw = wrapped(state.yaw + state.w * TICK_S)

    def _aim(self) -> tuple[float, float]:
        """Return the linear and angular velocity that the robot accelerates to now, m/s and rad/s."""
        goal = self.goal
        if goal is None:
            return self._command if self._until > self._tick else (0.0, 0.0)
        if not goal.reachable:
            self.goal = None
            return 0.0, 0.0
        state, build = self._state, self.build
        distance = math.hypot(goal.x - state.x, goal.y - state.y)
        if distance > _ARRIVED_M:
            off = wrapped(math.atan2(goal.y - state.y, goal.x - state.x) - state.yaw)
            turn = _bound(3 * off, build.turn_rad_s)
            # Turning on the spot first; then straight, with small corrections.
            return (0.0, turn) if abs(off) > 0.2 else (min(build.cruise_m_s, 0.03 + 1.5 * distance), turn)  # noqa: PLR2004 - rad
        off = wrapped(goal.yaw - state.yaw)
        if abs(off) > _ARRIVED_RAD:
            return 0.0, _bound(3 * off, build.turn_rad_s)
        self.goal = None
        return 0.0, 0.0


def _bound(value: float, size: float) -> float:
    return max(-size, min(size, value))


def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi], rad."""
    return math.remainder(angle, math.tau)


def yaw_of(q: dict[str, float]) -> float:
    """Return the heading of a quaternion, rad."""
    return math.atan2(2 * (q["w"] * q["z"] + q["x"] * q["y"]), 1 - 2 * (q["y"] ** 2 + q["z"] ** 2))


def pose(x: float, y: float, yaw: float) -> dict[str, Any]:
    """Return a geometry_msgs/Pose on the ground."""
    return {
        "position": {"x": x, "y": y, "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)},
    }


def stamp(seconds: float) -> dict[str, int]:
    """Return a time in s as a builtin_interfaces/Time."""
    return {"sec": int(seconds), "nanosec": min(999_999_999, int(seconds % 1 * 1e9))}


def twist(v: float, w: float) -> dict[str, Any]:
    """Return the geometry_msgs/Twist of a robot on wheels."""
    return {"linear": {"x": v, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": w}}


def _covariance(variance: float) -> list[float]:
    return [variance if row == column else 0.0 for row in range(6) for column in range(6)]
