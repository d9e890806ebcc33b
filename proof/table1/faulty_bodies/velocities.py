"""Bodies that drive at another velocity than commanded, or report a wrong pose, velocity or time."""

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from proof.table1.independent_robots.body import TICK_S, Body, stamp, twist, wrapped

_Message = dict[str, Any]


def _saying(changed: Callable[[_Message, float], None]) -> type[Body]:
    """Return a class of bodies whose odometry ``changed`` alters, given the message and the run time in s."""

    class Saying(Body):
        def __post_init__(self) -> None:
            super().__post_init__()
            self._born = time.time()

        def odometry(self) -> _Message:
            """Return the altered odometry."""
            message = super().odometry()
            changed(message, time.time() - self._born)
            return message

    return Saying


def _off_by(off: Callable[[float, float], float]) -> type[Body]:
    """Return a class of bodies whose stamps are off by ``off`` seconds, given the time and the run time in s."""

    def shift_stamp(message: _Message, age: float) -> None:
        shown = message["header"]["stamp"]
        now = shown["sec"] + shown["nanosec"] / 1e9
        message["header"]["stamp"] = stamp(now + off(now, age))

    return _saying(shift_stamp)


def _micro(message: _Message, _age: float) -> None:
    message["header"]["stamp"]["nanosec"] //= 1000


def _long(message: _Message, _age: float) -> None:
    orientation = message["pose"]["pose"]["orientation"]
    for axis in orientation:
        orientation[axis] *= 1.004


class _Late(Body):
    """A body that reports readings of ``late_s`` ago."""

    late_s = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._read: deque[tuple[float, _Message]] = deque()

    def _of_then(self, message: _Message) -> _Message:
        """Store the current message, and return an older one."""
        now = time.time()
        self._read.append((now, message))
        while len(self._read) > 1 and self._read[1][0] < now - self.late_s:
            self._read.popleft()
        return self._read[0][1]


class _LateOdometry(_Late):
    late_s = 0.7

    def odometry(self) -> _Message:
        """Return the odometry of 0.7 s ago."""
        return self._of_then(super().odometry())


class _LateVelocity(_Late):
    late_s = 0.5

    def velocity(self) -> _Message:
        """Return the velocity of half a second ago."""
        return self._of_then(super().velocity())


class _CommandedVelocity(Body):
    """A body that reports the commanded velocity instead of the measured one."""

    def velocity(self) -> _Message:
        """Return the commanded velocity."""
        with self._lock:
            self._advance()
            held = self._until > self._tick
            return twist(*(self._command if held else (self._state.v, self._state.w)))


class _ScaledBack(Body):
    """Moves backwards by a third more than its velocity."""

    def _advance(self) -> None:
        x, y = self._state.x, self._state.y
        super()._advance()
        if self._state.v < 0:
            self._state.x += 0.3 * (self._state.x - x)
            self._state.y += 0.3 * (self._state.y - y)


class _ScaledYaw(Body):
    """Turns by a quarter more than its velocity."""

    def _advance(self) -> None:
        yaw = self._state.yaw
        super()._advance()
        self._state.yaw = wrapped(self._state.yaw + 0.25 * wrapped(self._state.yaw - yaw))


READINGS: dict[str, type[Body]] = {
    "clock-fast": _off_by(lambda _now, age: 0.15 * age),
    "clock-slow": _off_by(lambda _now, age: -0.2 * age),
    "clock-steps-back": _off_by(lambda now, _age: -0.4 if int(now) % 3 == 0 else 0.0),
    "nanosec-is-microseconds": _saying(_micro),
    "quaternion-long": _saying(_long),
    "odometry-late": _LateOdometry,
    "velocity-late": _LateVelocity,
    "velocity-commanded": _CommandedVelocity,
    "back-scaled": _ScaledBack,
    "yaw-scaled": _ScaledYaw,
}


# Function from the commanded velocity (linear, angular) to the driven one.
_Driven = Callable[[float, float], tuple[float, float]]


def _holding(factor: Callable[[float, float | None], float]) -> type[Body]:
    """Return a class of bodies that hold a velocity ``factor`` times as long as declared.

    ``factor`` receives the linear and angular part; the angular part is None for a linear PUT.
    """

    class Holding(Body):
        def drive(self, v: float, w: float | None) -> float:
            """Command a velocity, and change its hold time."""
            with self._lock:
                kept = super().drive(v, w)
                self._until = self._tick + round(factor(v, w) * self.build.hold_s / TICK_S)
                return kept

    return Holding


class _WatchdogSometimes(Body):
    """A body whose watchdog stops every second velocity that is not renewed; the others go on for a minute."""

    _MINUTE = round(60 / TICK_S)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._ended = 0

    def _aim(self) -> tuple[float, float]:
        if self.goal is None and self._tick == self._until and any(self._command):
            self._ended += 1
            if self._ended % 2:
                self._until += self._MINUTE
        return super()._aim()


class _RenewedByChange(Body):
    """A body in which repeating the same velocity does not renew it."""

    def drive(self, v: float, w: float | None) -> float:
        """Command a velocity, unless it is the current one."""
        with self._lock:
            self._advance()
            before, until = self._command, self._until
            kept = super().drive(v, w)
            if before == self._command and until > self._tick:
                self._until = until
            return kept


def _driving(driven: _Driven) -> type[Body]:
    """Return a class of bodies that drive at the velocity ``driven`` returns, while no goal is active."""

    class Driving(Body):
        def _aim(self) -> tuple[float, float]:
            commanded = self.goal is None
            aim = super()._aim()
            return driven(*aim) if commanded else aim

    return Driving


class _SlowReversal(Body):
    """A body that brakes very slowly when commanded to reverse."""

    def _aim(self) -> tuple[float, float]:
        commanded, now = self.goal is None, self._state.v
        v, w = super()._aim()
        if commanded and v * now < 0 and abs(v - now) > 0.4:  # noqa: PLR2004 - m/s
            return now - math.copysign(0.001, now), w
        return v, w


class _DeadBase(Body):
    """A body that ignores velocities, with a statement whose limits are so low that rest is "near" each of them."""

    def __post_init__(self) -> None:
        """Lower the limits of the build to those of the statement."""
        self.build = replace(self.build, linear_m_s=0.12, angular_rad_s=0.25, cruise_m_s=0.24, turn_rad_s=0.5)
        super().__post_init__()

    def _aim(self) -> tuple[float, float]:
        commanded = self.goal is None
        aim = super()._aim()
        return (0.0, 0.0) if commanded else aim


class _AxesIgnored(Body):
    """A body that accepts velocities along six axes, as its statement declares, and moves along two."""

    further_axes = 0.3

    def __post_init__(self) -> None:
        """Lower the limit of turning to that of the other axes, because the statement has one figure for all."""
        self.build = replace(self.build, angular_rad_s=self.further_axes, turn_rad_s=0.29)
        super().__post_init__()


_LINEAR, _ANGULAR = 0.25, 1.2  # fast velocities for this robot, m/s and rad/s
_SLOW, _SLOW_TURN = 0.1, 0.6
_DEAD, _DEAD_TURN = 0.06, 0.25  # velocities that are too slow for its motors
_STEP = 0.1
_MOST_BACK, _MOST_TURN = 0.2, 1.3

VELOCITIES: dict[str, type[Body]] = {
    "hold-long": _holding(lambda _v, _w: 1.7),
    "hold-short": _holding(lambda _v, _w: 0.7),
    "hold-long-linear": _holding(lambda v, w: 2.0 if v and w is None else 1.0),
    "hold-forever-linear": _holding(lambda v, w: 40.0 if v and w is None else 1.0),
    "hold-long-slow": _holding(lambda v, w: 2.0 if w and abs(w) < _SLOW_TURN and abs(v) < _SLOW else 1.0),
    "hold-short-fast": _holding(lambda v, _w: 0.5 if abs(v) > _LINEAR else 1.0),
    "hold-forever-full-ahead": _holding(lambda v, w: 40.0 if v > 0 and w is not None else 1.0),
    "hold-forever-full-back": _holding(lambda v, w: 40.0 if v < 0 and w is not None else 1.0),
    "hold-forever-linear-ahead": _holding(lambda v, w: 40.0 if v > 0 and w is None else 1.0),
    "hold-forever-left": _holding(lambda _v, w: 40.0 if w and w > 0 else 1.0),
    "watchdog-sometimes": _WatchdogSometimes,
    "renewed-by-change": _RenewedByChange,
    "back-capped": _driving(lambda v, w: (max(v, -_MOST_BACK), w)),
    "left-capped": _driving(lambda v, w: (v, min(w, _MOST_TURN))),
    "right-capped": _driving(lambda v, w: (v, max(w, -_MOST_TURN))),
    "both-capped": _driving(lambda v, w: (v, 0.6 * w if abs(v) > _LINEAR and abs(w) > _ANGULAR else w)),
    "deadband": _driving(lambda v, w: (v if abs(v) > _DEAD else 0.0, w)),
    "deadband-angular": _driving(lambda v, w: (v, w if abs(w) > _DEAD_TURN else 0.0)),
    "steps": _driving(lambda v, w: (round(v / _STEP) * _STEP, w)),
    "mirrored-back": _driving(lambda v, w: (v, -w if v < 0 else w)),
    "drift": _driving(lambda v, w: (v, 0.12 if v and not w else w)),
    "slow-reversal": _SlowReversal,
    "dead-base": _DeadBase,
    "axes-ignored": _AxesIgnored,
}
