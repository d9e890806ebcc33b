"""Find single wrong readings of the state: values that no sample of the odometry can have had.

A wrong odometry sample is shown by every resource and fails nothing. But all responses with one stamp must show the
same values, and a velocity, or a pose over SOAP, must lie between the odometry samples shortly before and just after
it: a robot may smooth its velocity and lag one sample behind. What lies outside counts only when it happens repeatedly.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, Final, Generic, NamedTuple, TypeVar

import msgspec

from conformance.measures.samples import FARTHEST
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive_trace import LONGEST_SAMPLE_S
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.robot import Velocity, is_near
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case, case

Stamp = tuple[int, int]
_SAMPLE: Final = "rest-resources/pose-sample"
# How old a velocity may be compared with the odometry, s.
_BEHIND_S: Final = 0.4
# Odometry samples needed on either side of a velocity, without a gap: a velocity may be one message late.
_AROUND: Final = 2
# Samples are neighbours if their stamps differ by at most this multiple of the shortest difference.
_NEIGHBOURS: Final = 1.5
# Wrong readings needed: runs with good robots, even noisy ones, had none.
_SEVERAL: Final = 2
# _OUT: a reading is wrong if it is off by this many tolerances.
_OUT: Final = 1.5
_LAPSES: Final = 50
# Readings of one message that show a swap: one value, another, and the first again.
_TOLD: Final = 3
# Greatest difference between two responses by rounding, m, rad, m/s and rad/s.
_ABSOLUTE: Final = 0.02
# _PLACE_M: how far off a pose may be, m. _HEADING: how far off a heading, as a vector: a robot may turn between two
# samples.
_PLACE_M: Final = 0.05
_HEADING: Final = 0.2


class OneSample:
    """Judges that odometry responses with the same stamp contain the same pose and velocity.

    A robot that computes its pose for each request, under a coarse stamp, shows another pose each time; but it never
    returns to exactly the numbers from before. Only such a return fails.

    Args:
        limits: the robot's limits, whose noise may be in each response.
    """

    def __init__(self, limits: Limits) -> None:
        self._slack = _ABSOLUTE + FARTHEST * max(msgspec.structs.astuple(limits.noise))
        self._stamp: Stamp | None = None
        self._told: deque[tuple[dict[str, float], Exchange]] = deque(maxlen=_TOLD)

    def odometry(self, stamp: Stamp, message: Any, exchange: Exchange) -> Iterator[Case]:
        """Judge one reading; call it in the order of the requests."""
        if stamp != self._stamp:
            self._stamp = stamp
            self._told.clear()
        self._told.append((_numbers(message), exchange))
        if len(self._told) < _TOLD:
            return
        (first, _), (between, odd), (last, _) = self._told
        if first == last:
            problem = _difference(between, first, self._slack)
            yield case(
                _SAMPLE,
                not problem,
                odd,
                f"the odometry with the stamp {stamp[0]}.{stamp[1]:09} as in the response just before and just after",
                found=problem,
                cause="another value",
            )


def _numbers(message: Any) -> dict[str, float]:
    """Return the numbers of pose and twist by their places, without fields that the robot adds."""
    pose, twist = message["pose"]["pose"], message["twist"]["twist"]
    return {
        **{f"position.{axis}": pose["position"][axis] for axis in "xyz"},
        **{f"orientation.{axis}": pose["orientation"][axis] for axis in "xyzw"},
        **{f"{part}.{axis}": twist[part][axis] for part in ("linear", "angular") for axis in "xyz"},
    }


def _difference(between: dict[str, float], around: dict[str, float], slack: float) -> str:
    odd = (name for name, value in between.items() if abs(value - around[name]) > slack)
    return next((f"{name} is {between[name]!r} for {around[name]!r}" for name in odd), "")


class Place(NamedTuple):
    """A pose in numbers that change steadily while a robot turns: position, m, and heading as a vector."""

    x: float
    y: float
    ahead_x: float
    ahead_y: float

    @classmethod
    def of(cls, pose: Pose) -> Place:
        """Return the numbers of a pose."""
        return cls(pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw))


_Value = TypeVar("_Value", bound=Velocity | Place)


def _fits(limits: Limits, value: Velocity | Place, nearest: Velocity | Place) -> bool:
    if isinstance(value, Velocity) and isinstance(nearest, Velocity):
        return is_near(limits, value, nearest, _OUT)
    noise = limits.noise
    rooms = (_PLACE_M + FARTHEST * noise.position_m,) * 2 + (_HEADING + FARTHEST * noise.heading_rad,) * 2
    return all(abs(one - other) <= room for one, other, room in zip(value, nearest, rooms, strict=True))


class _Sample(NamedTuple, Generic[_Value]):
    """One reading of the odometry: stamp, s; value; when it was received, s of the monotonic clock."""

    stamp: float
    value: _Value
    received: float


class _Reading(NamedTuple, Generic[_Value]):
    """One reading of the value with the odometry samples read before and after it."""

    value: _Value
    exchange: Exchange
    before: tuple[_Sample[_Value], ...]
    after: list[_Sample[_Value]]


class BesideOdometry(Generic[_Value]):
    """Judges a run's readings of the velocity, or of the pose over SOAP, by the odometry samples around each.

    Args:
        limits: the robot's limits.
        out: number of wrong readings so far.

    Attributes:
        out: number of wrong readings.
        judged: number of readings that could be judged.
    """

    def __init__(self, limits: Limits, out: int = 0) -> None:
        self._limits = limits
        self._samples: deque[_Sample[_Value]] = deque()
        self._lapses: deque[float] = deque(maxlen=_LAPSES)
        self._readings: deque[_Reading[_Value]] = deque()
        self.out = out
        self.judged = 0

    def odometry(self, stamp: float, value: _Value, received: float) -> Iterator[Case]:
        """Take a reading of the odometry; yield the readings that can be judged now.

        Args:
            stamp: by the robot's clock, s.
            value: the odometry's.
            received: when it was received, s of the monotonic clock.
        """
        sample = _Sample(stamp, value, received)
        if self._samples and stamp > self._samples[-1].stamp:
            self._lapses.append(stamp - self._samples[-1].stamp)
        self._samples.append(sample)
        while len(self._samples) > _AROUND and self._samples[1].received < received - _BEHIND_S:
            self._samples.popleft()
        for reading in self._readings:
            reading.after.append(sample)
        while self._readings and len(self._readings[0].after) == _AROUND:
            yield from self._cases(self._readings.popleft())

    def reading(self, value: _Value, exchange: Exchange, received: float) -> None:
        """Take a reading that the odometry is compared with."""
        before = tuple(self._samples)
        if len(before) >= _AROUND and before[0].received < received - _BEHIND_S:
            self._readings.append(_Reading(value, exchange, before, []))

    def _cases(self, reading: _Reading[_Value]) -> Iterator[Case]:
        all_ = (*reading.before, *reading.after)
        if not self._neighbours([one.stamp for one in all_[-2 * _AROUND :]]):
            return
        nearest = _between(reading.value, [one.value for one in all_])
        noun = "pose" if isinstance(nearest, Place) else "velocity"
        fits = _fits(self._limits, reading.value, nearest)
        self.judged += 1
        self.out += not fits
        if fits or self.out >= _SEVERAL:
            yield Case(
                fits,
                reading.exchange,
                f"a {noun} that the odometry had before or after; the nearest is {nearest}",
                f"{reading.value}, and out so {self.out} times",
                "out now and then",
            )

    def _neighbours(self, stamps: list[float]) -> bool:
        """Return whether samples with these stamps are consecutive, so that none is missing between them."""
        if not self._lapses:
            return False
        hertz = self._limits.odometry_hz
        usual = 1 / hertz if hertz else min(*self._lapses, LONGEST_SAMPLE_S)
        return all(0 <= two - one <= _NEIGHBOURS * usual for one, two in itertools.pairwise(stamps))


def _between(value: Velocity | Place, around: Sequence[Velocity | Place]) -> Velocity | Place:
    """Return the value nearest to the given one whose components lie in the range of the others."""
    ranges = [(min(some), max(some)) for some in zip(*around, strict=True)]
    return type(value)(*(max(low, min(one, high)) for one, (low, high) in zip(value, ranges, strict=True)))
