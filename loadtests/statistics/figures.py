"""From cells to figures: the series of latency.json."""

from collections.abc import Sequence
from typing import Any

import msgspec

from loadtests.schedule.plan import SeriesName
from loadtests.statistics.histogram import SHARES, Histogram
from loadtests.statistics.intervals import Replicates, figure_interval_ms, samples_for_point
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Cell

_WITH_INTERVAL = ("p50", "p99")
_DIGITS = 6  # nanoseconds

#: Figures in milliseconds by name; None where there are too few samples.
Figures = dict[str, float | None]


class Series(msgspec.Struct, kw_only=True):
    """An entry of `series` in latency.json; the JSON Schema describes each field."""

    operation: str
    interface: str
    client: str
    count: int
    errors: int
    late: int
    dropped: int
    counted: int
    at_least: list[str]
    service_ms: Figures
    response_ms: Figures
    ci95_ms: dict[str, list[float] | None]
    response_ci95_ms: dict[str, list[float] | None]
    rounds: dict[str, Any]
    repeats: list[dict[str, Any]]
    spans_ms: dict[str, Figures | None]
    reasons: dict[str, str]
    request_bytes: int | None
    response_bytes: int | None
    histogram: str
    response_histogram: str
    failed_histogram: str | None
    failed_response_histogram: str | None
    modes: dict[str, Any] | None = None
    growth: dict[str, Any] | None = None

    @property
    def name(self) -> SeriesName:
        """Return the name of the series: operation, client and interface."""
        return self.operation, self.interface, self.client


def name_fields(name: SeriesName) -> dict[str, Any]:
    """Return a series' name in the fields of latency.json."""
    return dict(zip(("operation", "interface", "client"), name, strict=True))


def rounded(value: float | None) -> float | None:
    """Return a figure rounded to nanoseconds, which hides the error of binary fractions."""
    return None if value is None else round(value, _DIGITS)


def rounded_interval(interval: Sequence[float] | None) -> list[float] | None:
    """Return an interval as [lower, upper], both rounded to nanoseconds."""
    return None if interval is None else [round(bound, _DIGITS) for bound in interval]


def quantiles(histogram: Histogram) -> tuple[Figures, dict[str, str]]:
    """Return mean, quantiles and maximum in ms, and for each quantile that is None the reason."""
    reasons = {
        name: f"{histogram.total} samples; {name} needs {needed}"
        for name, share in SHARES.items()
        if histogram.total < (needed := samples_for_point(share))
    }
    names = ("mean", *SHARES, "max")
    return {name: None if name in reasons else rounded(histogram.figure_ms(name)) for name in names}, reasons


def plain_quantiles(histogram: Histogram) -> Figures:
    """Return mean, quantiles and maximum in ms."""
    return quantiles(histogram)[0]


def series(measured: Measured, sizes: dict[SeriesName, tuple[int, int]]) -> list[Series]:
    """Return the `series` of latency.json.

    Args:
        measured: what was recorded.
        sizes: bytes of request and response, as seen before the run.
    """
    return [_one_series(measured, name, *sizes.get(name, (None, None))) for name in measured.plan.series_names()]


def _one_series(measured: Measured, name: SeriesName, request: int | None, response: int | None) -> Series:
    whole, spans = measured.total(name, "duel"), measured.spans("duel", name)
    service = measured.whole(name, "service")
    service_ms, reasons = quantiles(service)
    intervals: dict[str, dict[str, list[float] | None]] = {"service": {}, "response": {}}
    rounds: dict[str, Any] = {}
    for time, kept in intervals.items():
        units = measured.units(name, time)
        for quantile in _WITH_INTERVAL:
            estimate = figure_interval_ms(units, quantile, measured.plan.load.seed)
            kept[quantile] = rounded_interval(estimate.interval)
            if estimate.reason:
                reasons[f"ci95 {quantile}"] = estimate.reason
            if time == "service":
                rounds[quantile] = rounds_of(estimate.replicates, measured.pair_s("duel", name))
    failed = (whole.failed_service, whole.failed_response)
    failed_service, failed_response = (part.encode() if part.total else None for part in failed)
    return Series(
        **name_fields(name),
        count=whole.service.total,
        errors=whole.errors,
        late=whole.late,
        dropped=whole.dropped,
        counted=service.total,
        at_least=_lower_bounds(service_ms, whole),
        service_ms=service_ms,
        response_ms=plain_quantiles(measured.whole(name, "response")),
        ci95_ms=intervals["service"],
        response_ci95_ms=intervals["response"],
        rounds=rounds,
        repeats=_repeats(measured, name),
        spans_ms={
            part: plain_quantiles(getattr(spans, part)) if getattr(spans, part).total else None
            for part in ("build", "wire", "server", "parse")
        },
        reasons=reasons,
        request_bytes=request,
        response_bytes=response,
        histogram=whole.service.encode(),
        response_histogram=whole.response.encode(),
        failed_histogram=failed_service,
        failed_response_histogram=failed_response,
    )


def _lower_bounds(found: Figures, whole: Cell) -> list[str]:
    """Return the service-time figures that rest on unanswered requests, so that they are lower bounds."""
    if not whole.failed_service.total:
        return []
    share = whole.service.total / (whole.service.total + whole.failed_service.total)
    names = [name for name, quantile in SHARES.items() if found[name] is not None and quantile > share]
    return ["mean", *names, "max"]


def rounds_of(replicates: Replicates | None, pair_s: float) -> dict[str, Any] | None:
    """Return how many resampled rounds an interval has, how long they are, and how much they correlate."""
    if replicates is None:
        return None
    rounds = replicates.rounds
    return {
        "number": rounds.sample.size,
        "pairs": rounds.length,
        "length_s": rounded(rounds.length * pair_s),
        "autocorrelation": {"pairs": rounded(rounds.unit_correlation), "rounds": rounded(rounds.correlation)},
        "widened": rounded(replicates.widening),
    }


def _repeats(measured: Measured, name: SeriesName) -> list[dict[str, Any]]:
    """Return the service time's figures of each repeat alone; empty if the run had no repeats."""
    if len(measured.repeats) == 1:
        return []
    found, seed = [], measured.plan.load.seed
    for repeat in measured.repeats:
        units = [unit for unit in measured.units(name, "service") if unit.repeat == repeat]
        whole = Histogram.sum_of(unit.sides[0] for unit in units)
        figures = plain_quantiles(whole)
        intervals = {q: figure_interval_ms(units, q, seed).interval for q in _WITH_INTERVAL}
        found.append(
            {"repeat": repeat, "count": whole.total}
            | {q: figures[q] for q in intervals}
            | {"ci95_ms": {q: rounded_interval(interval) for q, interval in intervals.items()}}
        )
    return found
