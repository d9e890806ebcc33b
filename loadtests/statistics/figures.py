"""From cells to figures: the series, comparisons and A/A controls of latency.json."""

from typing import Any

import msgspec

from loadtests.schedule.plan import SeriesName
from loadtests.statistics.between_runs import Interval
from loadtests.statistics.histogram import SHARES, Histogram
from loadtests.statistics.intervals import (
    LEAST_ROUNDS,
    Compared,
    Replicates,
    compare,
    figure_interval_ms,
    pooled_interval,
    samples_for_point,
)
from loadtests.statistics.judgement import Judgement, judge
from loadtests.statistics.measured import Measured, Side
from loadtests.statistics.recorder import Cell
from loadtests.statistics.rounds import Unit

BASE = "rest"
WEB_SERVICES = (BASE, "soap")
COMPARED = ("mean", "p50", "p90", "p99")
_WITH_INTERVAL = ("p50", "p99")
_DIGITS = 6  # nanoseconds

#: Figures in milliseconds by name; None where there are too few samples.
Figures = dict[str, float | None]


class Series(msgspec.Struct, kw_only=True):
    """An entry of `series` in latency.json; its schema says what each field holds."""

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
    after_pause: dict[str, Any] | None = None
    modes: dict[str, Any] | None = None

    @property
    def name(self) -> SeriesName:
        """Return what names the series."""
        return self.operation, self.interface, self.client


class Ratio(msgspec.Struct, kw_only=True):
    """Two sides at one quantile, as latency.json gives them: the second less the first, and over it.

    Attributes:
        reason: why there is no ratio, or no interval.
    """

    operation: str
    client: str
    quantile: str
    difference_ms: float | None
    ratio: float | None
    ci95: list[float] | None
    ci95_difference_ms: list[float] | None
    rounds: dict[str, Any] | None
    reason: str | None


class AaControl(Ratio, kw_only=True):
    """An interface against itself: an entry of `noise_floor`."""

    interface: str


class SoapOverRest(Ratio, kw_only=True):
    """SOAP against REST, and what may be claimed: an entry of `comparisons`."""

    difference_ms: float | None = msgspec.field(name="soap_minus_rest_ms")
    between_runs: float | None = None
    noise_ci95: list[float] | None = None
    judgement: str = "none"
    bound: float | None = None
    judgement_reason: str | None = None


class OverRest(Ratio, kw_only=True):
    """A further interface, such as rosbridge, against REST: an entry of `further_interfaces`."""

    interface: str
    difference_ms: float | None = msgspec.field(name="minus_rest_ms")


def named(name: SeriesName) -> dict[str, Any]:
    """Return a series' name in the fields of latency.json."""
    return dict(zip(("operation", "interface", "client"), name, strict=True))


def rounded(value: float | None) -> float | None:
    """Return a figure rounded to nanoseconds, which hides the error of binary fractions."""
    return None if value is None else round(value, _DIGITS)


def rounded_interval(interval: Interval | None) -> list[float] | None:
    """Return an interval, rounded likewise."""
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
    whole, spans = measured.total("duel", name), measured.spans("duel", name)
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
                rounds[quantile] = _rounds(estimate.replicates, measured.pair_s("duel", name))
    failed = (whole.failed_service, whole.failed_response)
    failed_service, failed_response = (part.encode() if part.total else None for part in failed)
    return Series(
        **named(name),
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
    """Return which figures of the service time stand for requests without a response, so that they are lower bounds."""
    if not whole.failed_service.total:
        return []
    share = whole.service.total / (whole.service.total + whole.failed_service.total)
    names = [name for name, quantile in SHARES.items() if found[name] is not None and quantile > share]
    return ["mean", *names, "max"]


def _rounds(replicates: Replicates | None, pair_s: float) -> dict[str, Any] | None:
    """Return what was resampled for an interval: how many rounds, how long, and how much they correlate."""
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
    """Return the service time's figures of each repeat alone; empty where there was one run."""
    if len(measured.plans) == 1:
        return []
    found = []
    for plan in measured.plans:
        units = [unit for unit in measured.units(name, "service") if unit.repeat == plan.repeat]
        whole = Histogram.sum_of(unit.sides[0] for unit in units)
        figures = plain_quantiles(whole)
        intervals = {q: figure_interval_ms(units, q, plan.load.seed).interval for q in _WITH_INTERVAL}
        found.append(
            {"repeat": plan.repeat, "count": whole.total}
            | {q: figures[q] for q in intervals}
            | {"ci95_ms": {q: rounded_interval(interval) for q, interval in intervals.items()}}
        )
    return found


def comparisons(measured: Measured, deviation: float) -> list[SoapOverRest]:
    """Compare the service times of SOAP and REST, by operation, client and quantile, judged by the A/A control.

    The library clients have no A/A control of their own: the wire client's serves for them too.

    Args:
        measured: what was recorded.
        deviation: relative standard deviation of the ratio between runs, as far as this run cannot show it.
    """
    found: list[SoapOverRest] = []
    if measured.plan.robots > 1:
        return found  # robots took turns, not interfaces
    names = set(measured.plan.series_names())
    for operation in measured.plan.operations:
        clients = [
            client
            for client in measured.plan.clients
            if all((operation, interface, client) in names for interface in WEB_SERVICES)
        ]
        controls = {quantile: aa_interval(measured, operation, quantile) for quantile in COMPARED} if clients else {}
        found += [
            comparison(measured, operation, client, quantile, controls[quantile], deviation)
            for client in clients
            for quantile in COMPARED
        ]
    return found


def comparison(
    measured: Measured, operation: str, client: str, quantile: str, control: Interval | None, deviation: float
) -> SoapOverRest:
    """Compare SOAP and REST at one quantile, judged by `control`, the interval of the A/A control."""
    rest, soap = (Side("duel", (operation, interface, client)) for interface in WEB_SERVICES)
    entry = SoapOverRest(operation=operation, client=client, **compared(measured, rest, soap, quantile, deviation))
    entry.between_runs, entry.noise_ci95 = rounded(deviation), rounded_interval(control)
    interval = None if entry.ci95 is None else (entry.ci95[0], entry.ci95[1])
    said = judge(entry.ratio, interval, control) if entry.ratio is not None else Judgement("none")
    entry.judgement, entry.bound = said.verdict, rounded(said.bound)
    entry.judgement_reason = said.reason or entry.reason
    return entry


def aa_interval(measured: Measured, operation: str, quantile: str) -> Interval | None:
    """Return the interval of the ratio that SOAP and REST came to against themselves, both pooled."""
    client, seed = measured.plan.clients[0], measured.plan.load.seed
    parts = [
        _enough(measured.paired(*_against_itself((operation, interface, client))), quantile, seed, stream=stream)
        for stream, interface in enumerate(WEB_SERVICES)
        if (operation, interface, client) in measured.plan.series_names()
    ]
    known = [part for part in parts if part is not None]
    return pooled_interval(known) if len(known) == len(parts) else None


def _against_itself(name: SeriesName) -> tuple[Side, Side]:
    return Side("aa", name, "a"), Side("aa", name, "b")


def aa_controls(measured: Measured) -> list[AaControl]:
    """Return the `noise_floor` of latency.json: the A/A control of each interface."""
    client = measured.plan.clients[0]
    return [
        AaControl(**named(name), **compared(measured, *_against_itself(name), quantile))
        for interface in measured.plan.interfaces
        for number in measured.plan.offered(interface, client)
        for name in [(measured.plan.operations[number], interface, client)]
        for quantile in COMPARED
    ]


def further_interfaces(measured: Measured) -> list[OverRest]:
    """Return the `further_interfaces` of latency.json: those beside SOAP and REST, each over REST."""
    names = measured.plan.series_names()
    return [
        OverRest(**named(name), **compared(measured, Side("duel", base), Side("duel", name), quantile))
        for name in names
        for base in [(name[0], BASE, name[2])]
        if name[1] not in WEB_SERVICES and base in names
        for quantile in COMPARED
    ]


def _samples(units: list[Unit]) -> int:
    """Return how many samples the side with fewer has."""
    return min((sum(unit.sides[side].total for unit in units) for side in (0, 1)), default=0)


def _needed(quantile: str) -> int:
    return 2 if quantile == "mean" else samples_for_point(SHARES[quantile])


def _enough(units: list[Unit], quantile: str, seed: int, *, stream: int = 0, deviation: float = 0.0) -> Compared | None:
    """Compare two sides where both have enough samples."""
    enough = _samples(units) >= _needed(quantile)
    return compare(units, quantile, seed, stream=stream, deviation=deviation) if enough else None


def compared(measured: Measured, first: Side, second: Side, quantile: str, deviation: float = 0.0) -> dict[str, Any]:
    """Compare two sides at one quantile; returns the fields of a `Ratio` but for its names."""
    units = measured.paired(first, second)
    result = _enough(units, quantile, measured.plan.load.seed, deviation=deviation)
    reason = None
    if result is None:
        reason = f"{_samples(units)} samples on one side; {quantile} needs {_needed(quantile)}"
    elif result.ci95 is None:
        reason = f"no interval: fewer than {LEAST_ROUNDS} rounds of blocks"
    return {
        "quantile": quantile,
        "difference_ms": rounded(result.difference_ms) if result else None,
        "ratio": rounded(result.ratio) if result else None,
        "ci95": rounded_interval(result.ci95) if result else None,
        "ci95_difference_ms": rounded_interval(result.ci95_difference_ms) if result else None,
        "rounds": _rounds(result.replicates, measured.pair_s(first.phase, first.name)) if result else None,
        "reason": reason,
    }
