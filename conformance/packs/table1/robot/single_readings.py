"""Find single wrong readings of the state: values that no sample of the odometry can have had.

A wrong odometry sample is shown by every resource and fails nothing. But all responses with one stamp must show the
same values, and a velocity must lie between the odometry samples shortly before and just after it: a robot may smooth
its velocity and lag one sample behind. A velocity outside them counts only when it happens repeatedly.
"""

import itertools
from collections import deque
from typing import Any, Final, NamedTuple

import msgspec

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.robot import FARTHEST, Velocity, is_near
from conformance.packs.table1.robot.windows import LONGEST_SAMPLE_S
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

Stamp = tuple[int, int]
_SAMPLE: Final = "rest-resources/pose-sample"
_VELOCITY: Final = "rest-resources/velocity-odometry"
# For so long a velocity may be behind the odometry, s.
_BEHIND_S: Final = 0.4
# Odometry read after it, and before it, without a sample in between that was not read: it may be a message behind.
_AROUND: Final = 2
# Samples are neighbours if their stamps are not farther apart than so many times the shortest lapse.
_NEIGHBOURS: Final = 1.5
# From so many on they are no chance: in whole runs of good robots, also of noisy ones, there was none.
_SEVERAL: Final = 2
# By so many tolerances a reading is out.
_OUT: Final = 1.5
_LAPSES: Final = 50
# A message is told one way, another way, and the first way again.
_TOLD: Final = 3
# What may be in one answer and not in another, for want of digits, m, rad, m/s and rad/s.
_ABSOLUTE: Final = 0.02


class OneSample:
    """Judges that odometry responses with the same stamp contain the same pose and velocity.

    A robot that computes its pose for each request, under a coarse stamp, shows another pose each time; but it never
    returns to exactly the numbers from before. Only such a return fails.

    Args:
        judge: takes the evidence.
        limits: the robot's limits, whose noise may be in each response.
    """

    def __init__(self, judge: Judge, limits: Limits) -> None:
        self._judge = judge
        self._slack = _ABSOLUTE + FARTHEST * max(msgspec.structs.astuple(limits.noise))
        self._stamp: Stamp | None = None
        self._told: deque[tuple[dict[str, float], Exchange]] = deque(maxlen=_TOLD)

    def odometry(self, stamp: Stamp, message: Any, exchange: Exchange) -> None:
        """Judge one reading; readings come in the order of their requests."""
        if stamp != self._stamp:
            self._stamp = stamp
            self._told.clear()
        self._told.append((_numbers(message), exchange))
        if len(self._told) < _TOLD:
            return
        (first, _), (between, odd), (last, _) = self._told
        if first == last:
            problem = _difference(between, first, self._slack)
            self._judge.check(
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


class _Sample(NamedTuple):
    """One reading of the odometry: stamp, s; velocity; when it was received, s of the monotonic clock."""

    stamp: float
    velocity: Velocity
    received: float


class _Reading(NamedTuple):
    """One reading of the velocity with the odometry samples read before and after it."""

    velocity: Velocity
    exchange: Exchange
    before: tuple[_Sample, ...]
    after: list[_Sample]


class BesideOdometry:
    """Judges a run's velocity readings by the odometry samples around each.

    Args:
        judge: takes the evidence.
        limits: the robot's limits.
        out: number of wrong readings so far.
        requirement: the requirement that the readings are judged by.

    Attributes:
        out: number of wrong readings.
        judged: number of readings that could be judged.
    """

    def __init__(self, judge: Judge, limits: Limits, out: int = 0, *, requirement: str = _VELOCITY) -> None:
        self._judge = judge
        self._limits = limits
        self._requirement = requirement
        self._samples: deque[_Sample] = deque()
        self._lapses: deque[float] = deque(maxlen=_LAPSES)
        self._readings: deque[_Reading] = deque()
        self.out = out
        self.judged = 0

    def odometry(self, stamp: float, velocity: Velocity, received: float) -> None:
        """Take a reading of the odometry; ``stamp``: by the robot's clock, s."""
        sample = _Sample(stamp, velocity, received)
        if self._samples and stamp > self._samples[-1].stamp:
            self._lapses.append(stamp - self._samples[-1].stamp)
        self._samples.append(sample)
        while len(self._samples) > _AROUND and self._samples[1].received < received - _BEHIND_S:
            self._samples.popleft()
        for reading in self._readings:
            reading.after.append(sample)
        while self._readings and len(self._readings[0].after) == _AROUND:
            self._judge_one(self._readings.popleft())

    def velocity(self, velocity: Velocity, exchange: Exchange, received: float) -> None:
        """Take a reading of the velocity."""
        before = tuple(self._samples)
        if len(before) >= _AROUND and before[0].received < received - _BEHIND_S:
            self._readings.append(_Reading(velocity, exchange, before, []))

    def _judge_one(self, reading: _Reading) -> None:
        all_ = (*reading.before, *reading.after)
        if not self._neighbours(all_[-2 * _AROUND :]):
            return
        nearest = _between(reading.velocity, [one.velocity for one in all_])
        fits = is_near(self._limits, reading.velocity, nearest, _OUT)
        self.judged += 1
        self.out += not fits
        if fits or self.out >= _SEVERAL:
            self._judge.check(
                self._requirement,
                fits,
                reading.exchange,
                f"a velocity that the odometry had before or after; the nearest is {nearest}",
                found=f"{reading.velocity}, and out so {self.out} times",
                cause="out now and then",
            )

    def _neighbours(self, around: tuple[_Sample, ...]) -> bool:
        """Return whether these samples are consecutive, so that the suite missed none between them."""
        if not self._lapses:
            return False
        hertz = self._limits.odometry_hz
        usual = 1 / hertz if hertz else min(*self._lapses, LONGEST_SAMPLE_S)
        return all(0 <= two.stamp - one.stamp <= _NEIGHBOURS * usual for one, two in itertools.pairwise(around))


def _between(velocity: Velocity, around: list[Velocity]) -> Velocity:
    """Return the velocity nearest to the given one whose components lie within the range of the others."""
    ranges = [(min(some), max(some)) for some in zip(*around, strict=True)]
    return Velocity(*(max(low, min(one, high)) for one, (low, high) in zip(velocity, ranges, strict=True)))
