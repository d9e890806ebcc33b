"""The histograms while they grow, for Prometheus: `--metrics-port`."""

from collections.abc import Callable, Iterator

import numpy as np
from gevent.pywsgi import WSGIServer
from prometheus_client import CollectorRegistry, make_wsgi_app
from prometheus_client.core import CounterMetricFamily, HistogramMetricFamily, Metric

from loadtests.measuring.errors import GeneratorError
from loadtests.schedule.plan import SERIES
from loadtests.statistics.histogram import Histogram, edges_us
from loadtests.statistics.recorder import Cell, Recorder

#: Upper bounds in microseconds, 1-2-5 from 10 us to 10 s.
BOUNDS_US = (*tuple(digit * 10**power for power in range(1, 7) for digit in (1, 2, 5)), 10000000)
_LABELS = ("operation", "interface", "client", "phase")


def buckets(histogram: Histogram) -> list[tuple[str, float]]:
    """Return the cumulative counts of a histogram in Prometheus' form: pairs (upper bound in seconds, count)."""
    bins, counts = histogram.arrays()
    lower, width = edges_us(bins)
    within = np.searchsorted(lower + width - 1, BOUNDS_US, side="right")
    cumulative = np.concatenate([[0], np.cumsum(counts)])[within].astype(float).tolist()
    bounds = [repr(bound / 1e6) for bound in BOUNDS_US]
    return [*zip(bounds, cumulative, strict=True), ("+Inf", float(histogram.total))]


class Collector:
    """Reads a recorder whenever Prometheus scrapes."""

    def __init__(self, recorder: Callable[[], Recorder], operations: tuple[str, ...]) -> None:
        self._recorder = recorder
        self._operations = operations
        self.series_of: dict[int, int] = {}

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics, for prometheus_client."""
        recorder = self._recorder()
        recorder.flush()
        sums: dict[tuple[int, int], Cell] = {}
        for (segment, operation), cell in list(recorder.cells.items()):
            sums.setdefault((self.series_of.get(segment, -1), operation), Cell()).merge(cell)
        service = HistogramMetricFamily("roaas_service_seconds", "From actual start to last octet.", labels=_LABELS)
        response = HistogramMetricFamily("roaas_response_seconds", "From intended start.", labels=_LABELS)
        errors = CounterMetricFamily("roaas_errors", "Requests that failed.", labels=_LABELS)
        for (number, operation), cell in sorted(sums.items()):
            if number < 0:
                continue
            phase, interface, client = SERIES[number]
            labels = (self._operations[operation], interface, client, phase)
            for family, histogram in ((service, cell.service), (response, cell.response)):
                family.add_metric(labels, buckets(histogram), sum_value=histogram.sum_ns / 1e9)
            errors.add_metric(labels, cell.errors)
        yield service
        yield response
        yield errors


def serve(collector: Collector, host: str, port: int) -> WSGIServer:
    """Serve /metrics.

    Raises:
        GeneratorError: the port is in use.
    """
    registry = CollectorRegistry(auto_describe=False)
    registry.register(collector)
    server = WSGIServer((host, port), make_wsgi_app(registry), log=None, error_log=None)
    try:
        server.start()
    except OSError as error:
        raise GeneratorError(
            f"the metrics port {host}:{port} is in use: choose another with --metrics-port ({error})"
        ) from None
    return server
