"""From cells to figures: series, comparisons, noise floor, time series and errors of latency.json."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

from loadtests.schedule.plan import SERIES, Plan, SeriesName
from loadtests.statistics.intervals import (
    LEAST_BLOCKS,
    SHARES,
    Interval,
    compare,
    quantile_interval_ms,
    samples_for_point,
)
from loadtests.statistics.recorder import Cell, Recorder, Spans

if TYPE_CHECKING:
    from loadtests.statistics.histogram import Histogram

_NS = 1_000_000_000
COMPARED = ("mean", "p50", "p90", "p99")
WIDTH_S = 1.0
_DIGITS = 6  # nanoseconds


def named(name: SeriesName) -> dict[str, Any]:
    """A series' name, as latency.json gives it."""
    return dict(zip(("operation", "interface", "client"), name, strict=True))


def rounded(value: float | None) -> float | None:
    """A figure without the noise of binary fractions."""
    return None if value is None else round(value, _DIGITS)


def rounded_interval(interval: Interval | None) -> list[float] | None:
    """An interval likewise."""
    return None if interval is None else [round(bound, _DIGITS) for bound in interval]


def quantiles(histogram: Histogram) -> tuple[dict[str, float | None], dict[str, str]]:
    """Mean, quantiles and maximum in ms; and why those are null that are."""
    found: dict[str, float | None] = {"mean": rounded(histogram.mean_ms())}
    reasons = {}
    for name, share in SHARES.items():
        needed = samples_for_point(share)
        if histogram.total >= needed:
            found[name] = rounded(histogram.quantile_ms(share))
        else:
            found[name] = None
            reasons[name] = f"{histogram.total} samples; {name} needs {needed}"
    found["max"] = rounded(histogram.highest_ns / 1e6) if histogram.total else None
    return found, reasons


def plain_quantiles(histogram: Histogram) -> dict[str, float | None]:
    """`quantiles` without the reasons."""
    return quantiles(histogram)[0]


class Measured:
    """A plan's cells in order, by series."""

    def __init__(self, plan: Plan, recorder: Recorder) -> None:
        self.plan = plan
        self.recorder = recorder

    def blocks(self, phase: str, name: SeriesName, label: str | None = None) -> list[tuple[int, Cell]]:
        """A series' cells with the pair that each belongs to, in order of time."""
        operation, interface, client = name
        number = self.plan.operations.index(operation)
        found = []
        for index, segment in enumerate(self.plan.segments):
            if (segment.phase, segment.interface, segment.client) != (phase, interface, client):
                continue
            if label is not None and segment.label != label:
                continue
            cell = self.recorder.cells.get((self.plan.first_segment + index, number))
            if cell is not None:
                found.append((segment.pair, cell))
        return found

    def total(self, phase: str, name: SeriesName) -> Cell:
        """A series' cells added up."""
        whole = Cell()
        for _, cell in self.blocks(phase, name):
            whole.merge(cell)
        return whole

    def interval(
        self, name: SeriesName, time: str, quantile: str, phase: str = "duel"
    ) -> tuple[list[float] | None, str | None]:
        """The 95 % interval in ms of a series' service or response time in a phase; or None, and why."""
        histograms = [getattr(cell, time) for _, cell in self.blocks(phase, name)]
        interval, reason = quantile_interval_ms(histograms, quantile, self.plan.load.seed)
        return rounded_interval(interval), reason

    def spans(self, phase: str, name: SeriesName) -> Spans:
        """Where a series' time went."""
        operation, interface, client = name
        key = (SERIES.index((phase, interface, client)), self.plan.operations.index(operation))
        return self.recorder.spans.get(key, Spans())


def series(measured: Measured, sizes: dict[SeriesName, tuple[int, int]]) -> list[dict[str, Any]]:
    """The `series` of latency.json; `sizes` are octets of request and response, as seen before the run."""
    found = []
    for name in measured.plan.series_names():
        whole = measured.total("duel", name)
        spans = measured.spans("duel", name)
        service, reasons = quantiles(whole.service)
        intervals: dict[str, dict[str, Any]] = {"service": {}, "response": {}}
        for quantile in ("p50", "p99"):
            for time, kept in intervals.items():
                kept[quantile], reason = measured.interval(name, time, quantile)
                if reason:
                    reasons[f"ci95 {quantile}"] = reason
        request, response = sizes.get(name, (None, None))
        found.append(
            named(name)
            | {
                "count": whole.service.total,
                "errors": whole.errors,
                "late": whole.late,
                "dropped": whole.dropped,
                "service_ms": service,
                "response_ms": plain_quantiles(whole.response),
                "ci95_ms": intervals["service"],
                "response_ci95_ms": intervals["response"],
                "spans_ms": {
                    part: plain_quantiles(getattr(spans, part)) if getattr(spans, part).total else None
                    for part in ("build", "wire", "server", "parse")
                },
                "reasons": reasons,
                "request_bytes": request,
                "response_bytes": response,
                "histogram": whole.service.encode(),
                "response_histogram": whole.response.encode(),
            }
        )
    return found


def comparisons(measured: Measured) -> list[dict[str, Any]]:
    """SOAP against REST, by operation, client and quantile, over the service time."""
    found: list[dict[str, Any]] = []
    if measured.plan.robots > 1:
        return found  # robots took turns, not interfaces
    names = set(measured.plan.series_names())
    for operation in measured.plan.operations:
        for client in measured.plan.clients:
            sides = [(operation, interface, client) for interface in ("rest", "soap")]
            if not all(side in names for side in sides):
                continue
            first, second = (dict(_services(measured.blocks("duel", side))) for side in sides)
            pairs = [(first[pair], second[pair]) for pair in sorted(set(first) & set(second))]
            found += [
                {"operation": operation, "client": client}
                | compared(pairs, quantile, measured.plan.load.seed, "soap_minus_rest_ms")
                for quantile in COMPARED
            ]
    return found


def noise_floor(measured: Measured) -> list[dict[str, Any]]:
    """A/A: each interface against itself."""
    found: list[dict[str, Any]] = []
    client = measured.plan.clients[0]
    for interface in measured.plan.interfaces:
        for number in measured.plan.offered(interface, client):
            name = (measured.plan.operations[number], interface, client)
            first, second = (dict(_services(measured.blocks("aa", name, label))) for label in ("a", "b"))
            pairs = [(first[pair], second[pair]) for pair in sorted(set(first) & set(second))]
            found += [
                named(name) | compared(pairs, quantile, measured.plan.load.seed, "difference_ms")
                for quantile in COMPARED
            ]
    return found


def _services(blocks: list[tuple[int, Cell]]) -> list[tuple[int, Histogram]]:
    return [(pair, cell.service) for pair, cell in blocks]


def compared(pairs: list[tuple[Histogram, Histogram]], quantile: str, seed: int, difference: str) -> dict[str, Any]:
    """Two sides by their pairs of blocks, at one quantile: what latency.json says, `difference` being its key."""
    fewest = min((sum(pair[side].total for pair in pairs) for side in (0, 1)), default=0)
    needed = 2 if quantile == "mean" else samples_for_point(SHARES[quantile])
    result = compare(pairs, quantile, seed) if fewest >= needed else None
    reason = None
    if result is None:
        reason = f"{fewest} samples on one side; {quantile} needs {needed}"
    elif result.ci95 is None:
        reason = f"no interval: fewer than {LEAST_BLOCKS} pairs of blocks"
    return {
        "quantile": quantile,
        difference: rounded(result.difference_ms) if result else None,
        "ratio": rounded(result.ratio) if result else None,
        "ci95": rounded_interval(result.ci95) if result else None,
        "ci95_difference_ms": rounded_interval(result.ci95_difference_ms) if result else None,
        "reason": reason,
    }


def time_series(measured: Measured) -> dict[str, Any]:
    """Each series second by second (or block by block, where blocks are longer), by intended start."""
    width = max(WIDTH_S, measured.plan.block_s)
    found = []
    for operation, interface, client in measured.plan.series_names():
        number = measured.plan.operations.index(operation)
        seconds: dict[int, Cell] = defaultdict(Cell)
        for index, segment in enumerate(measured.plan.segments):
            if segment.phase not in {"duel", "aa"} or (segment.interface, segment.client) != (interface, client):
                continue
            cell = measured.recorder.cells.get((measured.plan.first_segment + index, number))
            if cell is not None:
                seconds[int(segment.start_ns / _NS / width + 1e-9)].merge(cell)
        points = [
            {
                "t_s": round(second * width, 3),
                "count": cell.service.total,
                "errors": cell.errors,
                "p50_ms": rounded(cell.response.quantile_ms(0.5)),
                "p99_ms": rounded(cell.response.quantile_ms(0.99)),
                "max_ms": rounded(cell.response.highest_ns / 1e6) if cell.response.total else None,
            }
            for second, cell in sorted(seconds.items())
        ]
        found.append(named((operation, interface, client)) | {"points": points})
    return {"width_s": width, "series": found}


def errors(recorder: Recorder, operations: tuple[str, ...]) -> list[dict[str, Any]]:
    """Failures, grouped, most frequent first."""
    found = []
    for (number, operation, kind), failure in recorder.failures.items():
        phase, interface, client = SERIES[number]
        found.append(
            named((operations[operation], interface, client))
            | {
                "phase": phase,
                "kind": kind,
                "message": failure.message,
                "count": failure.count,
                "first_s": round(max(0.0, failure.first_ns / _NS), 3),
                "last_s": round(max(0.0, failure.last_ns / _NS), 3),
            }
        )
    return sorted(found, key=lambda entry: -int(str(entry["count"])))
