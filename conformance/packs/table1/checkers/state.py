"""Judge every GET of the robot's state in a run, whichever check sends it, and find single wrong readings.

A fault in one of fifty responses is found only by reading often, so the reads of all checks count.

A wrong odometry sample is shown by every resource and fails nothing. But all responses with one stamp must show the
same values, and a velocity, or a pose over SOAP, must lie between the odometry samples shortly before and just after
it: a robot may smooth its velocity and lag one sample behind. What lies outside counts only when it happens repeatedly.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from http import HTTPStatus
from statistics import median
from typing import Any, Final, Generic, NamedTuple, TypeVar

import msgspec

from conformance.documents.json_shape import Shape
from conformance.measures.samples import FARTHEST, SEVERAL
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.clock import Clock
from conformance.packs.table1.robot.drive_trace import LONGEST_SAMPLE_S
from conformance.packs.table1.robot.geometry import Pose, length_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, TWIST, VECTOR3, read_as
from conformance.packs.table1.robot.robot import LINEAR, POSE, VELOCITY, Velocity, is_near
from conformance.transport.credentials import Credentials
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case, case

_READINGS: Final[dict[str, tuple[str, Shape, str]]] = {
    POSE: ("rest-resources/pose-type", ODOMETRY, "status 200 with a complete nav_msgs/Odometry"),
    VELOCITY: ("rest-resources/velocity-type", TWIST, "status 200 with a complete geometry_msgs/Twist"),
    LINEAR: ("rest-resources/linear-type", VECTOR3, "status 200 with a complete geometry_msgs/Vector3"),
}
_PLAIN_FIELDS: Final = frozenset({"host", "accept", "connection"})
_PLAIN_ACCEPT: Final = frozenset({"", "*/*", "application/json"})
_UNIT: Final = 1e-3
# Odometry first seen this long ago is older than one second by any clock, s.
_OLD_S: Final = 1.5


class _Samples:
    """The newest velocities in one resource's responses, one for each odometry stamp."""

    def __init__(self) -> None:
        self._newest: deque[Any] = deque(maxlen=SEVERAL)
        self._stamp: tuple[int, int] | None = None
        self._begun = -math.inf

    def add(self, twist: Any, stamp: tuple[int, int] | None, now: float) -> None:
        """Add a velocity at a time, s; ``stamp`` is that of the odometry read last by any resource."""
        if self._newest and stamp == self._stamp and now - self._begun < LONGEST_SAMPLE_S:
            self._newest[-1] = twist
            return
        self._newest.append(twist)
        self._stamp, self._begun = stamp, now

    def fastest(self, part: str) -> float:
        """Return the largest of the components' medians; 0 while there are too few samples."""
        if len(self._newest) < SEVERAL:
            return 0.0
        return max(abs(median(float(twist[part][axis]) for twist in self._newest)) for axis in "xyz")


class State:
    """Judges the plain GETs of the state in all exchanges of one run."""

    def __init__(self, url: Callable[[str], str], limits: Limits, clock: Clock, credentials: Credentials) -> None:
        self._limits, self._clock, self._credentials = limits, clock, credentials
        self._readings = {url(path): (path, *reading) for path, reading in _READINGS.items()}
        self._last_stamp: tuple[int, int] | None = None
        self._last_received = 0.0
        # When the odometry last got a new stamp.
        self._fresh_at = math.inf
        self._none: bool = False
        self._velocity_of_none: Exchange | None = None  # returned although the robot had no odometry
        # Single readings, one after another.
        self._sample = OneSample(limits)
        self._beside = BesideOdometry[Velocity](limits)
        self._read_until = 0.0
        self._fast = {path: _Samples() for path in _READINGS}

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Judge one exchange if it is a plain GET of the robot's state."""
        reading = self._readings.get(attempt.request.url)
        if reading is None or not isinstance(attempt, Exchange) or not self._plain(attempt):
            return
        exchange, response = attempt, attempt.response
        if response.status == HTTPStatus.TOO_MANY_REQUESTS:
            return
        path, id_, shape, expected = reading
        if response.status == HTTPStatus.SERVICE_UNAVAILABLE:
            yield from self._unavailable(path, exchange)
            return
        value, problem = read_as(response, shape)
        yield case(id_, not problem, exchange, expected, found=problem)
        if problem:
            return
        yield from self._single(path, value, exchange)
        if path == POSE:
            self._none = False
            yield from self._odometry(value, exchange)
            value = value["twist"]["twist"]
            self._velocity_of_none = None
        else:
            self._velocity_of_none = exchange if self._none else None
            value = {"linear": value} if path == LINEAR else value
        yield from self._within_limits(self._fast[path], value, exchange)

    def _single(self, path: str, value: Any, exchange: Exchange) -> Iterator[Case]:
        """Compare successive single readings; skip those of concurrent clients."""
        received = exchange.response.received_s
        if received - exchange.response.elapsed_ms / 1000 < self._read_until:
            self._sample, self._beside = OneSample(self._limits), BesideOdometry(self._limits, self._beside.out)
        self._read_until = max(self._read_until, received)
        if path == POSE:
            stamp = value["header"]["stamp"]["sec"], value["header"]["stamp"]["nanosec"]
            yield from self._sample.odometry(stamp, value, exchange)
            velocity = Velocity.of(value["twist"]["twist"])
            for one in self._beside.odometry(stamp[0] + stamp[1] / 1e9, velocity, received):
                yield replace(one, requirement="rest-resources/velocity-odometry")
        elif path == VELOCITY:
            self._beside.reading(Velocity.of(value), exchange, received)

    def _unavailable(self, path: str, exchange: Exchange) -> Iterator[Case]:
        """Judge a 503: it must have Retry-After, and the velocity must be 503 as well."""
        name = "pose-unavailable" if path == POSE else "pose-fresh"
        after = bool(exchange.response.header("retry-after"))
        yield case(f"rest-resources/{name}", after, exchange, "Retry-After with 503")
        if path == POSE:
            # Judge it later: the velocity may have been read just before odometry came.
            if self._none and self._velocity_of_none is not None:
                earlier = self._velocity_of_none
                expected = "503 for the velocity while the pose is 503"
                yield case("rest-resources/pose-fresh", holds=False, exchange=earlier, expected=expected)
            self._none, self._velocity_of_none = True, None

    def _plain(self, exchange: Exchange) -> bool:
        """Return whether a request has only usual headers, so that the robot must respond 200."""
        # A check may send wrong credentials or none, to see them refused.
        request, own = exchange.request, self._credentials.fields(shown=True)
        if (
            request.method != "GET"
            or not set(own) <= set(request.headers)
            or request.query != self._credentials.target("", shown=True)
        ):
            return False
        fields = {name.lower(): value for name, value in request.headers if (name, value) not in own}
        return fields.keys() <= _PLAIN_FIELDS and fields.get("accept", "") in _PLAIN_ACCEPT and not request.raw

    def _odometry(self, odometry: Any, exchange: Exchange) -> Iterator[Case]:
        length = length_of(odometry["pose"]["pose"]["orientation"])
        yield case(
            "rest-resources/pose-quaternion",
            abs(length - 1) <= _UNIT,
            exchange,
            "an orientation of unit length within 1e-3",
            found=f"an orientation of length {length:.6g}",
        )
        # Responses of several clients are judged one after another, when all have come.
        now, elapsed_ms = exchange.response.received_s, exchange.response.elapsed_ms
        sent = now - elapsed_ms / 1000
        stamp = (int(odometry["header"]["stamp"]["sec"]), int(odometry["header"]["stamp"]["nanosec"]))
        # Two exchanges that overlapped have no order.
        if self._last_stamp is not None and sent >= self._last_received:
            yield case(
                "rest-resources/pose-stamp",
                stamp >= self._last_stamp,
                exchange,
                "a stamp that never runs backwards",
                found=f"the stamp (sec, nanosec) {stamp} after {self._last_stamp}",
                cause="runs backwards",
            )
        if stamp != self._last_stamp:
            self._fresh_at = now
        elif sent > self._fresh_at + _OLD_S:
            yield case(
                "rest-resources/pose-fresh",
                holds=False,
                exchange=exchange,
                expected="503 where the odometry is older than one second",
                found=f"a stamp that has not changed for {sent - self._fresh_at:.1f} s",
                cause="old",
            )
        self._clock.take(now - elapsed_ms / 2000, stamp[0] + stamp[1] / 1e9)
        self._clock.add(stamp[0] + stamp[1] / 1e9, exchange.response.header("date") or "")
        self._last_stamp = max(stamp, self._last_stamp) if self._last_stamp else stamp
        self._last_received = max(self._last_received, now)

    def _within_limits(self, samples: _Samples, twist: Any, exchange: Exchange) -> Iterator[Case]:
        """Judge that the measured speed is within the declared limits, also while the robot pursues a goal."""
        limits = self._limits
        samples.add(twist, self._last_stamp, exchange.response.received_s)
        linear, angular = limits.tolerance_linear_m_s, limits.tolerance_angular_rad_s
        for part, limit, absolute, noise in (
            ("linear", limits.navigation_m_s, linear, limits.noise.linear_m_s),
            ("angular", limits.navigation_rad_s, angular, limits.noise.angular_rad_s),
        ):
            declared = limits.linear_declared if part == "linear" else limits.angular_declared
            if part not in twist or not declared:
                continue
            fastest = samples.fastest(part)
            room = absolute + FARTHEST * noise / math.sqrt(SEVERAL)
            yield case(
                "safety/limits-hold",
                fastest <= limit * (1 + limits.tolerance) + room,
                exchange,
                f"a measured {part} speed within the limit of {limit:g}",
                found=f"a {part} speed of {fastest:.4g}",
            )


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
_OUT: Final = 1.5  # a reading is wrong if it is off by this many tolerances
_LAPSES: Final = 50
# Readings of one message that show a swap: one value, another, and the first again.
_TOLD: Final = 3
# Greatest difference between two responses by rounding, m, rad, m/s and rad/s.
_ABSOLUTE: Final = 0.02
_PLACE_M: Final = 0.05  # error that a pose may have, m
_HEADING: Final = 0.2  # error of a heading, as a vector: a robot may turn between two samples


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
                f"{reading.value}; {self.out} readings differ like this",
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
