"""Judge every GET of the robot's state in a run, whichever check sends it.

A fault in one of fifty responses is found only by reading often, so the reads of all checks count.
"""

import math
from collections import deque
from http import HTTPStatus
from statistics import median
from typing import Any, Final

from conformance.api.rest.interface import RestInterface
from conformance.documents.json_schema import Shape
from conformance.observe.clock import WALL_CLOCK
from conformance.packs.table1.robot.clock import Clock
from conformance.packs.table1.robot.geometry import length_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, TWIST, VECTOR3, read_as
from conformance.packs.table1.robot.robot import FARTHEST, LINEAR, POSE, VELOCITY, Velocity
from conformance.packs.table1.robot.single_readings import BesideOdometry, OneSample
from conformance.packs.table1.robot.windows import LONGEST_SAMPLE_S, SEVERAL
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import record
from conformance.transport.exchange import Exchange, Listener

_READINGS: Final[dict[str, tuple[str, Shape, str]]] = {
    POSE: ("rest-resources/pose-type", ODOMETRY, "status 200 with a complete nav_msgs/Odometry"),
    VELOCITY: ("rest-resources/velocity-type", TWIST, "status 200 with a complete geometry_msgs/Twist"),
    LINEAR: ("rest-resources/linear-type", VECTOR3, "status 200 with a complete geometry_msgs/Vector3"),
}
_PLAIN_FIELDS: Final = frozenset({"host", "accept", "connection"})
_PLAIN_ACCEPT: Final = frozenset({"", "*/*", "application/json"})
_UNIT: Final = 1e-3
# Odometry that has been seen before so long ago is older than one second by all clocks, s.
_OLD_S: Final = 1.5


class _Samples:
    """The newest velocities in one resource's responses, one for each odometry stamp."""

    def __init__(self) -> None:
        self._newest: deque[Any] = deque(maxlen=SEVERAL)
        self._stamp: tuple[int, int] | None = None
        self._begun = -math.inf

    def add(self, twist: Any, stamp: tuple[int, int] | None) -> None:
        """Add a velocity; ``stamp`` is that of the odometry read last by any resource."""
        now = WALL_CLOCK.now()
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


class Observer(Listener):
    """Listens to all exchanges of one run and judges the plain GETs."""

    def __init__(self, api: RestInterface, clock: Clock) -> None:
        self._api = api
        self._clock = clock
        self._readings = {api.client.url(path): (path, *reading) for path, reading in _READINGS.items()}
        self._last_stamp: tuple[int, int] | None = None
        self._last_received = 0.0
        # When the odometry had a stamp that it had not before, and what told a velocity although there was no odometry.
        self._fresh_at = math.inf
        self._none: bool = False
        self._velocity_of_none: Exchange | None = None
        # Single readings, one after another.
        self._sample = OneSample(api.run.judge, said_of(api.run).limits)
        self._beside = BesideOdometry[Velocity](said_of(api.run).limits)
        self._read_until = 0.0
        self._fast = {path: _Samples() for path in _READINGS}

    def answered(self, exchange: Exchange) -> None:
        """Judge one exchange if it is a plain GET of the robot's state."""
        reading = self._readings.get(exchange.request.url)
        if reading is None or exchange.request.method != "GET" or not self._plain(exchange):
            return
        response = exchange.response
        if response.status == HTTPStatus.TOO_MANY_REQUESTS:
            return
        path, id_, shape, expected = reading
        judge = self._api.run.judge
        if response.status == HTTPStatus.SERVICE_UNAVAILABLE:
            self._unavailable(path, exchange)
            return
        value, problem = read_as(response, shape)
        if not judge.check(id_, not problem, exchange, expected, found=problem):
            return
        self._single(path, value, exchange)
        if path == POSE:
            self._none = False
            self._odometry(value, exchange, response.elapsed_ms)
            value = value["twist"]["twist"]
            self._velocity_of_none = None
        else:
            self._velocity_of_none = exchange if self._none else None
            value = {"linear": value} if path == LINEAR else value
        self._limits(self._fast[path], value, exchange)

    def _single(self, path: str, value: Any, exchange: Exchange) -> None:
        """Compare single readings that came one after another; skip those read by several clients at once."""
        judge, limits = self._api.run.judge, said_of(self._api.run).limits
        received = _received_s(exchange)
        if received - exchange.response.elapsed_ms / 1000 < self._read_until:
            self._sample, self._beside = OneSample(judge, limits), BesideOdometry(limits, self._beside.out)
        self._read_until = max(self._read_until, received)
        if path == POSE:
            stamp = value["header"]["stamp"]["sec"], value["header"]["stamp"]["nanosec"]
            self._sample.odometry(stamp, value, exchange)
            velocity = Velocity.of(value["twist"]["twist"])
            outcomes = self._beside.odometry(stamp[0] + stamp[1] / 1e9, velocity, received)
            record(judge, "rest-resources/velocity-odometry", outcomes)
        elif path == VELOCITY:
            self._beside.reading(Velocity.of(value), exchange, received)

    def _unavailable(self, path: str, exchange: Exchange) -> None:
        """Judge a 503: it must have Retry-After, and the velocity must be 503 as well."""
        judge = self._api.run.judge
        name = "pose-unavailable" if path == POSE else "pose-fresh"
        after = bool(exchange.response.header("retry-after"))
        judge.check(f"rest-resources/{name}", after, exchange, "Retry-After with 503")
        if path == POSE:
            # Not at once: the velocity may have been asked for just before the odometry came, or was too old.
            if self._none and self._velocity_of_none is not None:
                earlier = self._velocity_of_none
                expected = "503 for the velocity while the pose is 503"
                judge.check("rest-resources/pose-fresh", holds=False, exchange=earlier, expected=expected)
            self._none, self._velocity_of_none = True, None

    def _plain(self, exchange: Exchange) -> bool:
        """Return whether a request has only usual headers, so that the robot must answer 200."""
        # A check may send other credentials than the client's own, or none, to see them refused.
        credentials = self._api.client.connection.credentials
        request, own = exchange.request, credentials.fields(shown=True)
        if not set(own) <= set(request.headers) or request.query != credentials.target("", shown=True):
            return False
        fields = {name.lower(): value for name, value in request.headers if (name, value) not in own}
        return fields.keys() <= _PLAIN_FIELDS and fields.get("accept", "") in _PLAIN_ACCEPT and not request.raw

    def _odometry(self, odometry: Any, exchange: Exchange, elapsed_ms: float) -> None:
        judge = self._api.run.judge
        length = length_of(odometry["pose"]["pose"]["orientation"])
        judge.check(
            "rest-resources/pose-quaternion",
            abs(length - 1) <= _UNIT,
            exchange,
            "an orientation of unit length within 1e-3",
            found=f"an orientation of length {length:.6g}",
        )
        # Of several clients' answers one is told after another, when all have come.
        now = _received_s(exchange)
        sent = now - elapsed_ms / 1000
        stamp = (int(odometry["header"]["stamp"]["sec"]), int(odometry["header"]["stamp"]["nanosec"]))
        # Two answers that crossed on their way say nothing of order.
        if self._last_stamp is not None and sent >= self._last_received:
            judge.check(
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
            judge.check(
                "rest-resources/pose-fresh",
                holds=False,
                exchange=exchange,
                expected="503 where the odometry is older than one second",
                found=f"odometry that came {sent - self._fresh_at:.1f} s ago already",
                cause="old",
            )
        self._clock.take(now - elapsed_ms / 2000, stamp[0] + stamp[1] / 1e9)
        self._clock.dated(stamp[0] + stamp[1] / 1e9, exchange.response.header("date") or "")
        self._last_stamp = max(stamp, self._last_stamp) if self._last_stamp else stamp
        self._last_received = max(self._last_received, now)

    def _limits(self, samples: _Samples, twist: Any, exchange: Exchange) -> None:
        """Judge that the measured speed is within the declared limits, also while the robot pursues a goal."""
        limits = said_of(self._api.run).limits
        samples.add(twist, self._last_stamp)
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
            self._api.run.judge.check(
                "safety/limits-hold",
                fastest <= limit * (1 + limits.tolerance) + room,
                exchange,
                f"a measured {part} speed within the limit of {limit:g}",
                found=f"a {part} speed of {fastest:.4g}",
            )


def _received_s(exchange: Exchange) -> float:
    """Return when a response arrived, s of the monotonic clock."""
    return exchange.response.received_s or WALL_CLOCK.now()
