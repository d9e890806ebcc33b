"""Records of each process during a plan: requests, failures, and its own processor time."""

import gc
import time
from collections.abc import Callable, Mapping
from typing import Any

import gevent

from loadtests.clients.failures import CallError
from loadtests.clients.wire import now_ns
from loadtests.schedule.plan import SERIES, Plan, Segment
from loadtests.statistics.histogram import Histogram, edges_us
from loadtests.statistics.recorder import Recorder

NS = 1_000_000_000
_FLUSH_S = 1.0
AFTER_ERROR_S = 0.02  # closed model: users of a dead robot would spin on refused connections


class LocustFeed:
    """Copies our requests into a Locust environment's statistics, for its web UI.

    Locust itself rounds to milliseconds, and its request event costs some 8 us. Here whole buffers of successful
    requests go in at once, with the histogram's microseconds as keys. Failures, which are rare, go through the event,
    where other listeners expect them.

    Args:
        environment: Locust's.
        methods: the HTTP method over REST of each operation, in the plan's order.
    """

    def __init__(self, environment: Any, methods: Mapping[str, str]) -> None:
        self._environment = environment
        self._methods = methods
        self._operations = tuple(methods)

    def _entry(self, series: int, operation: int) -> tuple[str, str]:
        """Return the method and the name under which Locust shows a series."""
        _, interface, client = SERIES[series]
        name = self._operations[operation]
        method = self._methods[name] if interface == "rest" else interface.upper()
        return method, f"{name} {interface} {client}"

    def succeeded(self, series: int, operation: int, response: Histogram) -> None:
        """Add successful requests' response times."""
        if series < 0 or SERIES[series][0] == "warmup":
            return
        method, name = self._entry(series, operation)
        stats = self._environment.stats
        bins, counts = response.arrays()
        lower, _ = edges_us(bins)
        times = dict(zip((lower / 1e3).tolist(), counts.tolist(), strict=True))
        now = time.time()
        for entry in (stats.get(name, method), stats.total):
            if entry.use_response_times_cache and int(now) > int(entry.last_request_timestamp or now):
                entry._cache_response_times(int(now) - 1)  # noqa: SLF001 -- what StatsEntry.log does each second
            entry.num_requests += response.total
            entry.total_response_time += response.sum_ns / 1e6
            entry.min_response_time = min(response.lowest_ns / 1e6, entry.min_response_time or float("inf"))
            entry.max_response_time = max(response.highest_ns / 1e6, entry.max_response_time)
            entry.last_request_timestamp = now
            entry.num_reqs_per_sec[int(now)] += response.total
            for time_ms, count in times.items():
                entry.response_times[time_ms] += count

    def failed(self, series: int, operation: int, error: CallError) -> None:
        """Report a failed request."""
        if series >= 0:
            method, name = self._entry(series, operation)
            self._environment.events.request.fire(
                request_type=method, name=name, response_time=0, response_length=0, exception=error, context={}
            )


class Recording:
    """The records of one process over its plans.

    Args:
        environment: Locust's.
        methods: the HTTP method of each operation, in the plan's order.
        timeout_s: deadline of a request.

    Attributes:
        busy: how many requests are under way.
        cpu_share: share of a core that this process used in the measured part of the plan.
        after_segment: called in the gap after each segment.
    """

    def __init__(self, environment: Any, methods: Mapping[str, str], timeout_s: float) -> None:
        self.series_of: dict[int, int] = {}
        self.segments: dict[int, Segment] = {}
        self.feed = LocustFeed(environment, methods)
        self.recorder = Recorder(self.series_of, self.feed.succeeded)
        self.origin_ns = self.offset_ns = self.first = self.busy = 0
        self.cpu_share: float | None = None
        self.after_segment: Callable[[], None] | None = None
        self.timeout_s = timeout_s
        self._flushed = 0.0
        self._cpu: list[tuple[float, float]] = []
        self._block: tuple[int, float, float] | None = None

    def begin(self, plan: Plan, origin_ns: int) -> None:
        """Begin a plan, whose times count from `origin_ns` (monotonic)."""
        self.first = plan.first_segment
        self.series_of.update(plan.series_of())
        self.segments.update({plan.first_segment + index: segment for index, segment in enumerate(plan.segments)})
        self.origin_ns, self.offset_ns = origin_ns, int(plan.offset_s * NS)
        since_s, until_s = plan.measured_s
        measured = plan.first_segment + sum(segment.phase == "warmup" for segment in plan.segments)
        window = plan.first_segment, origin_ns + int(since_s * NS), origin_ns + int(until_s * NS), measured
        self.recorder.window = window
        self._cpu, self._block = [], None
        gc.collect()
        gc.freeze()  # what exists now lives on: a collection in mid-run would look like a stall of the robot

    def failed(
        self, segment: int, operation: int, error: CallError, due_ns: int, start_ns: int, until_ns: int | None = None
    ) -> None:
        """Record a failed request that was given up at `until_ns` (default: now), by the run's clock."""
        until = now_ns() if until_ns is None else until_ns
        self.recorder.fail(
            segment,
            operation,
            error.kind,
            str(error),
            due_ns - self.origin_ns + self.offset_ns,
            (until - start_ns, until - due_ns),
        )
        self.feed.failed(self.series_of.get(segment, -1), operation, error)

    def between(self, index: int) -> None:
        """In the gap before a segment, sort the recorded times into bins and read the processor time."""
        number = index + self.first
        now = self.look_at_processor(number)
        segment = self.segments[number]
        if segment.gap or now[0] - self._flushed > _FLUSH_S:  # without a gap it delays what is due
            self.recorder.flush()
            self._flushed = now[0]
        if self._cpu and segment.phase != "warmup":
            spent = now[1] - self._cpu[0][1]
            elapsed = now[0] - self._cpu[0][0]
            if elapsed > 0:
                self.cpu_share = min(1.0, spent / elapsed)
        elif segment.phase != "warmup":
            self._cpu = [now]
        if self.after_segment is not None:
            self.after_segment()

    def look_at_processor(self, following: int | None) -> tuple[float, float]:
        """Record the share of a core that the last segment used, in the gap before segment `following`, if any."""
        now = (time.monotonic(), time.process_time())
        if self._block is not None and now[0] > self._block[1]:
            segment, began, spent = self._block
            self.recorder.was_busy(segment, min(1.0, (now[1] - spent) / (now[0] - began)))
        self._block = None if following is None else (following, *now)
        return now

    def wait_for_answers(self) -> None:
        """Wait until no request is under way; each has its own deadline."""
        with gevent.Timeout(self.timeout_s + 1, exception=False):
            while self.busy:
                gevent.sleep(0.01)
