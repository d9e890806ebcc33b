"""Locust's own statistics, fed so that its web UI shows what our histograms contain.

Locust itself rounds to milliseconds, and its request event costs some 8 us. Here whole buffers of successful requests
go in at once, with the histogram's microseconds as keys. Failures, which are rare, go through the event, where other
listeners expect them.
"""

import time
from collections.abc import Mapping
from typing import Any

from loadtests.clients.failures import CallError
from loadtests.schedule.plan import SERIES
from loadtests.statistics.histogram import Histogram, edges_us


class LocustFeed:
    """Adds our requests to the statistics of a Locust environment.

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
