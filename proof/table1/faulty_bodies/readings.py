"""Bodies that report a wrong pose, velocity or time."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from proof.table1.independent_robots.body import Body, stamp, twist, wrapped

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
