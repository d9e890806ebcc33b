"""Record requests and failures, in memory that does not grow with their number.

A request is nine integers appended to a buffer; NumPy bins the buffer in the quiet gap between blocks. A cell holds
the histograms of one operation in one segment of the plan (a block): the statistics resample blocks, and a series is
their sum. The plan bounds the number of segments, and the histogram the number of bins. Cells add, so that those of
several processes merge into exactly their union.
"""

from array import array
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Self

import numpy as np

from loadtests.statistics.histogram import Histogram, Ints

#: A start later than this after its time counts as late.
LATE_NS = 1_000_000
_FIELDS = 9
_BUFFERED = 4096 * _FIELDS
#: How many operations a plan may have.
MOST_OPERATIONS = 1024
_MAX_KINDS = 100  # error messages kept apart; further ones are counted under their kind's first


class Offset(NamedTuple):
    """Bounds on the robot's clock less ours, in s."""

    low_s: float
    high_s: float

    @property
    def middle_s(self) -> float:
        """Return the middle."""
        return (self.low_s + self.high_s) / 2

    @property
    def error_s(self) -> float:
        """Return by how much the middle may be wrong."""
        return (self.high_s - self.low_s) / 2


SHARED = Offset(0.0, 0.0)


@dataclass(slots=True)
class Cell:
    """One operation in one segment: histograms of the successful requests, and the ages of the others.

    Attributes:
        service, response: times of the successful requests.
        failed_service, failed_response: of the others, until they were given up, from the actual and from the
            intended start. A request that never started has its wait in both.
        queued: how long arrivals waited for a user, from when the pacer saw that none was free.
        errors: requests that failed; late: started over 1 ms after their time; dropped: never started.
    """

    service: Histogram = field(default_factory=Histogram)
    response: Histogram = field(default_factory=Histogram)
    failed_service: Histogram = field(default_factory=Histogram)
    failed_response: Histogram = field(default_factory=Histogram)
    queued: Histogram = field(default_factory=Histogram)
    errors: int = 0
    late: int = 0
    dropped: int = 0

    def merge(self, other: Self) -> None:
        """Add another cell."""
        for name, part in self.histograms().items():
            part.merge(getattr(other, name))
        self.errors += other.errors
        self.late += other.late
        self.dropped += other.dropped

    def histograms(self) -> dict[str, Histogram]:
        """Return its histograms by name."""
        return {name: getattr(self, name) for name in _HISTOGRAMS}


_HISTOGRAMS = ("service", "response", "failed_service", "failed_response", "queued")


@dataclass(slots=True)
class Spans:
    """Where the time of a series went, and how late the generator started its requests."""

    build: Histogram = field(default_factory=Histogram)
    wire: Histogram = field(default_factory=Histogram)
    server: Histogram = field(default_factory=Histogram)
    parse: Histogram = field(default_factory=Histogram)
    lag: Histogram = field(default_factory=Histogram)

    def parts(self) -> dict[str, Histogram]:
        """Return the histograms by name."""
        return {name: getattr(self, name) for name in ("build", "wire", "server", "parse", "lag")}

    def merge(self, other: Self) -> None:
        """Add another series' spans."""
        for name, part in self.parts().items():
            part.merge(getattr(other, name))


@dataclass(slots=True)
class Failure:
    """One kind of error in one series."""

    message: str
    count: int
    first_ns: int
    last_ns: int

    def merge(self, other: Self) -> None:
        """Add further failures of this kind."""
        if other.first_ns < self.first_ns:
            self.message = other.message
        self.count += other.count
        self.first_ns = min(self.first_ns, other.first_ns)
        self.last_ns = max(self.last_ns, other.last_ns)


#: (segment, operation)
CellKey = tuple[int, int]
#: (segment's series number, operation, kind)
FailureKey = tuple[int, int, str]


class Recorder:
    """The records of a run so far.

    Args:
        series_of: the series number of each segment (`Plan.series_of`); spans and errors are kept by series.
        listener: receives each buffer's response times, by series and operation.

    Attributes:
        window: the plan under way: its first segment, when its measured part begins and ends (monotonic ns), and the
            first segment of that part.
        live: all response times so far.
        in_time, afterwards: successful responses that came within that part, and those to its requests that came
            after it, by the plan's first segment.
    """

    def __init__(
        self, series_of: dict[int, int] | None = None, listener: Callable[[int, int, Histogram], None] | None = None
    ) -> None:
        self.series_of = series_of if series_of is not None else {}
        self.listener = listener
        self.window = (0, 0, 0, 0)
        self._buffer = array("q")
        self._begin()

    def _begin(self) -> None:
        self.cells: defaultdict[CellKey, Cell] = defaultdict(Cell)
        self.spans: defaultdict[tuple[int, int], Spans] = defaultdict(Spans)
        self.failures: dict[FailureKey, Failure] = {}
        self.counters: Counter[str] = Counter()
        self.live = Histogram()
        self.in_time: Counter[int] = Counter()
        self.afterwards: Counter[int] = Counter()
        self.busy: dict[int, float] = {}
        self.faults: list[str] = []

    def record(
        self,
        segment: int,
        operation: int,
        due: int,
        start: int,
        built: int,
        received: int,
        done: int,
        server: int,
        *,
        noticed: int = 0,
    ) -> None:
        """Record a successful request (moments in monotonic ns; `server` a duration, -1 when unknown).

        `noticed` is when the generator saw that no connection was free for it; 0 if one was free.
        """
        self._buffer.extend((segment, operation, due, start, built, received, done, server, noticed))
        if len(self._buffer) >= _BUFFERED:
            self.flush()

    def fail(
        self, segment: int, operation: int, kind: str, message: str, due_ns: int, ages_ns: tuple[int, int] = (0, 0)
    ) -> None:
        """Record a failed request.

        `due_ns` counts from the run's start; `ages_ns` are the times from its actual and its intended start until it
        was given up.
        """
        cell = self.cells[segment, operation]
        cell.errors += 1
        cell.failed_service.record(np.array(ages_ns[:1]))
        cell.failed_response.record(np.array(ages_ns[1:]))
        key = (self.series_of.get(segment, -1), operation, kind)
        if key not in self.failures and len(self.failures) >= _MAX_KINDS:
            key = (key[0], operation, "other")
        self._add(key, Failure(message, 1, due_ns, due_ns))

    def _add(self, key: FailureKey, failure: Failure) -> None:
        known = self.failures.get(key)
        if known is None:
            self.failures[key] = failure
        else:
            known.merge(failure)

    def drop(self, segment: int, operation: int, age_ns: int = 0) -> None:
        """Record an arrival that was not started before its deadline, `age_ns` after it was due."""
        cell = self.cells[segment, operation]
        cell.dropped += 1
        age = np.array([age_ns])
        cell.failed_service.record(age)
        cell.failed_response.record(age)

    def fault(self, message: str) -> None:
        """Record that the scenario itself failed, which ends the run."""
        if message not in self.faults:
            self.faults.append(message)

    def was_busy(self, segment: int, share: float) -> None:
        """Record the share of a core that a generator process used during a segment; the highest share is kept."""
        self.busy[segment] = max(share, self.busy.get(segment, 0.0))

    def count(self, name: str, number: int = 1) -> None:
        """Add to a counter that belongs to no series."""
        self.counters[name] += number

    def flush(self) -> None:
        """Add the buffered times to the histograms."""
        if not self._buffer:
            return
        rows = np.frombuffer(self._buffer, dtype=np.int64).reshape(-1, _FIELDS).copy()
        self._buffer = array("q")
        plan, since, until, measured = self.window
        done = rows[:, 6]
        self.in_time[plan] += int(((done >= since) & (done <= until)).sum())
        self.afterwards[plan] += int(((done > until) & (rows[:, 0] >= measured)).sum())
        keys = rows[:, 0] * MOST_OPERATIONS + rows[:, 1]
        for key in np.unique(keys).tolist():
            chosen = keys == key
            self._bin(key // MOST_OPERATIONS, key % MOST_OPERATIONS, rows[chosen])

    def _bin(self, segment: int, operation: int, rows: Ints) -> None:
        due, start, built, received, done, server, noticed = (rows[:, column] for column in range(2, _FIELDS))
        queued = noticed > 0
        cell = self.cells[segment, operation]
        cell.service.record(done - start)
        response = Histogram()
        response.record(done - due)
        cell.response.merge(response)
        self.live.merge(response)
        if self.listener is not None:
            self.listener(self.series_of.get(segment, -1), operation, response)
        cell.late += int(((start - due > LATE_NS) | queued).sum())
        cell.queued.record(np.maximum((start - noticed)[queued], 0))
        spans = self.spans[self.series_of.get(segment, -1), operation]
        told = np.clip(server, 0, received - built)  # the robot's clock may be coarser than ours
        spans.build.record(built - start)
        spans.wire.record(received - built - told)
        spans.server.record(told[server >= 0])
        spans.parse.record(done - received)
        spans.lag.record(np.maximum(np.where(queued, noticed, start) - due, 0))

    def merge(self, other: Self) -> None:
        """Add all records of another recorder."""
        for key, cell in other.cells.items():
            self.cells[key].merge(cell)
            self.live.merge(cell.response)
        for series, spans in other.spans.items():
            self.spans[series].merge(spans)
        for kind, failure in other.failures.items():
            self._add(kind, replace(failure))
        self.counters.update(other.counters)
        self.in_time.update(other.in_time)
        self.afterwards.update(other.afterwards)
        for segment, share in other.busy.items():
            self.was_busy(segment, share)
        for message in other.faults:
            self.fault(message)

    def take(self) -> dict[str, Any]:
        """Return everything in a form that msgpack carries, and begin again."""
        self.flush()
        packed = {
            "cells": [
                [
                    *key,
                    {name: part.pack() for name, part in cell.histograms().items() if part.total},
                    cell.errors,
                    cell.late,
                    cell.dropped,
                ]
                for key, cell in self.cells.items()
            ],
            "spans": [
                [*key, {name: part.pack() for name, part in spans.parts().items()}] for key, spans in self.spans.items()
            ],
            "failures": [
                [*key, failure.message, failure.count, failure.first_ns, failure.last_ns]
                for key, failure in self.failures.items()
            ],
            "counters": dict(self.counters),
            "in_time": list(self.in_time.items()),
            "afterwards": list(self.afterwards.items()),
            "busy": list(self.busy.items()),
            "faults": self.faults,
        }
        self._begin()
        return packed

    @classmethod
    def unpack(cls, packed: dict[str, Any]) -> Self:
        """Return the recorder that `take` packed."""
        made = cls()
        for segment, operation, parts, errors, late, dropped in packed["cells"]:
            histograms = {name: Histogram.unpack(part) for name, part in parts.items()}
            made.cells[segment, operation] = Cell(**histograms, errors=errors, late=late, dropped=dropped)
        for series, operation, parts in packed["spans"]:
            made.spans[series, operation] = Spans(**{name: Histogram.unpack(part) for name, part in parts.items()})
        for series, operation, kind, message, count, first, last in packed["failures"]:
            made.failures[series, operation, kind] = Failure(message, count, first, last)
        made.counters.update(packed["counters"])
        made.in_time.update(dict(packed["in_time"]))
        made.afterwards.update(dict(packed["afterwards"]))
        made.busy.update(packed["busy"])
        made.faults = packed["faults"]
        return made
