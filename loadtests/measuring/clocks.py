"""Differences of clocks: the robot's by its HTTP responses, workers' by messages to the master.

An exchange gives the offset as in NTP (RFC 5905, section 8), with one time of the worker instead of two, because the
worker responds at once: the worker's clock minus the middle between sending and receiving. Of several exchanges the one
with the shortest round trip counts, because it waited least in queues; its error is at most half its round trip. Clocks
are CLOCK_MONOTONIC, in ns, which no administrator sets.
"""

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, NamedTuple, Self

import gevent
import msgspec
from jsonpath import JSONPointer

from loadtests.statistics.recorder import Offset

#: Unix time from these numbers on is in nanoseconds, microseconds and milliseconds: as seconds it would lie after 5000.
_UNITS = ((1e17, 1e9), (1e14, 1e6), (1e11, 1e3))
_FLOAT_S = 1e-6  # what a 64-bit number can tell of today's Unix time, and what Python's `datetime` can


class Stamp(NamedTuple):
    """A stamp: Unix time, and the value of its last digit, in s."""

    seconds: float
    digit_s: float


def stamp_of(message: bytes, pointer: JSONPointer) -> Stamp | None:
    """Return the stamp in a JSON message: a number, an ISO 8601 text, or ROS's sec and nanosec; None without one."""
    try:
        value: Any = pointer.resolve(msgspec.json.decode(message), default=None)
        if isinstance(value, dict):
            whole: Any = value.get("sec", value.get("secs"))
            part: Any = value.get("nanosec", value.get("nsecs", 0))
            return Stamp(float(whole) + float(part) / 1e9, _FLOAT_S if part else 1.0)
        if isinstance(value, str) and not value.replace(".", "", 1).isdigit():
            moment = datetime.fromisoformat(value)
            seconds = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
            return Stamp(seconds, _digit(value.partition("T")[2].partition("+")[0].rstrip("Z")))
        number = float(value)
    except (msgspec.DecodeError, ValueError, TypeError, OverflowError, RecursionError):
        return None
    unit = next((unit for least, unit in _UNITS if number >= least), 1.0)
    return Stamp(number / unit, max(_digit(str(value)) / unit, _FLOAT_S))


def _digit(text: str) -> float:
    """Return the value of the last digit of a decimal number."""
    return float(max(10.0 ** -len(text.partition(".")[2]), _FLOAT_S))


#: How many exchanges a reading chooses from, and how long they may take in all.
EXCHANGES = 8
WITHIN_S = 2.0
_MESSAGE = "roaas_clock"


def clock_id() -> str:
    """Return which monotonic clock this process reads: running system and time namespace; empty where unknown."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()
    except OSError:
        return ""
    try:
        return f"{boot} {Path('/proc/self/ns/time').readlink()}"
    except OSError:  # a kernel without time namespaces
        return boot


class Reading(NamedTuple):
    """One exchange: the worker's clock less the master's, and the round trip, in ns."""

    offset_ns: int
    round_trip_ns: int

    @classmethod
    def of(cls, sent_ns: int, worker_ns: int, received_ns: int) -> Self:
        """Return the reading from the times at which the master sent, the worker responded and the master received."""
        return cls(worker_ns - (sent_ns + received_ns) // 2, received_ns - sent_ns)


def best(readings: Iterable[Reading]) -> Reading | None:
    """Return the reading with the shortest round trip."""
    return min(readings, key=lambda reading: reading.round_trip_ns, default=None)


@dataclass(slots=True)
class WorkerClock:
    """A worker's clock, as read over the run.

    Attributes:
        shared: the worker uses the master's clock.
        first, last: readings; None until the worker answered.
    """

    shared: bool = False
    first: Reading | None = None
    last: Reading | None = None

    def add(self, reading: Reading) -> None:
        """Add a further reading."""
        self.first = self.first or reading
        self.last = reading

    def of_master(self, moment_ns: int) -> int | None:
        """Return a moment of the master's clock on the worker's clock; None where the offset is unknown."""
        if self.shared:
            return moment_ns
        return moment_ns + self.last.offset_ns if self.last is not None else None

    @property
    def uncertainty_ns(self) -> int:
        """Return by how much the offset may be wrong: half a round trip."""
        return self.last.round_trip_ns // 2 if self.last is not None else 0

    def figures(self) -> dict[str, Any] | None:
        """Return the `clock` of a worker in latency.json; None if the worker never responded."""
        if self.first is None or self.last is None:
            return None
        return {
            "shared": self.shared,
            "offset_ms": round(self.last.offset_ns / 1e6, 3),
            "uncertainty_ms": round(self.uncertainty_ns / 1e6, 3),
            "round_trip_ms": round(self.last.round_trip_ns / 1e6, 3),
            "change_ms": round((self.last.offset_ns - self.first.offset_ns) / 1e6, 3),
        }


class Clocks:
    """Reads the workers' clocks, for the master."""

    def __init__(self, runner: Any) -> None:
        self._runner = runner
        self._asked: dict[str, list[Reading]] = {}
        runner.register_message(_MESSAGE, self._on_answer)

    def read(self, clients: Iterable[str]) -> dict[str, Reading]:
        """Exchange messages with all clients in parallel; the result lacks those that did not respond in time."""
        self._asked = {client: [] for client in clients}
        for client in self._asked:
            self._ask(client)
        deadline = time.monotonic() + WITHIN_S
        while time.monotonic() < deadline and any(len(r) < EXCHANGES for r in self._asked.values()):
            gevent.sleep(0.002)
        found = {client: best(readings) for client, readings in self._asked.items()}
        self._asked = {}
        return {client: reading for client, reading in found.items() if reading is not None}

    def _ask(self, client: str) -> None:
        self._runner.send_message(_MESSAGE, {"sent": time.monotonic_ns()}, client)

    def _on_answer(self, environment: Any, msg: Any) -> None:
        received = time.monotonic_ns()
        del environment
        readings = self._asked.get(msg.node_id)
        if readings is None:
            return  # too late: the reading is complete without it
        readings.append(Reading.of(msg.data["sent"], msg.data["worker"], received))
        if len(readings) < EXCHANGES:
            self._ask(msg.node_id)


def answer_clock(runner: Any) -> None:
    """Make a worker answer the master's exchanges at once."""

    def on_asked(environment: Any, msg: Any) -> None:
        del environment
        runner.send_message(_MESSAGE, {"sent": msg.data["sent"], "worker": time.monotonic_ns()})

    runner.register_message(_MESSAGE, on_asked)


#: `Date` has whole seconds, and is "at any time during message origination" (RFC 9110 section 6.6.1): servers that
#: write it beforehand, such as uvicorn, keep it for a second.
_DATE_S = 1.0
_KEPT_S = 1.0


@dataclass
class RobotClock:
    """The bounds that responses have shown so far; all moments are Unix time by our clock."""

    low_s: float = -math.inf
    high_s: float = math.inf

    def data(self, stamp: Stamp, received_s: float) -> None:
        """Take the stamp of data."""
        self.low_s = max(self.low_s, stamp.seconds - stamp.digit_s - received_s)

    def add_stamp(self, stamp: Stamp, sent_s: float, received_s: float) -> None:
        """Record the time in a response at which the robot made it."""
        self.data(stamp, received_s)
        self.high_s = min(self.high_s, stamp.seconds + stamp.digit_s - sent_s)

    def add_date(self, date: bytes | None, sent_s: float, received_s: float) -> None:
        """Take a response's `Date`, if it has one."""
        try:
            seconds = parsedate_to_datetime((date or b"").decode("latin-1")).timestamp()
        except ValueError:
            return
        self.low_s = max(self.low_s, seconds - received_s)
        self.high_s = min(self.high_s, seconds + _DATE_S + _KEPT_S - sent_s)

    @property
    def offset(self) -> Offset | None:
        """Return the offset; None where it is not known, or where its bounds contradict one another."""
        known = math.isfinite(self.low_s) and math.isfinite(self.high_s) and self.low_s <= self.high_s
        return Offset(self.low_s, self.high_s) if known else None
