"""From cells to figures: series, comparisons and noise floor of latency.json."""

from typing import Any

from loadtests.schedule.plan import SeriesName
from loadtests.statistics.between_runs import Interval
from loadtests.statistics.histogram import Histogram
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
from loadtests.statistics.rounds import SHARES, Unit

_COMPARED_INTERFACES = ("rest", "soap")
COMPARED = ("mean", "p50", "p90", "p99")
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


def rounds_of(replicates: Replicates | None, pair_s: float) -> dict[str, Any] | None:
    """What was resampled for an interval: how many rounds of which length, and how they depend on one another."""
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


def pair_s(measured: Measured, phase: str, name: SeriesName) -> float:
    """How much of the run's time lies between one pair of a series' blocks and the next."""
    pairs = len({place for place, _, _ in measured.blocks(phase, name)})
    return sum(plan.load.duration_s for plan in measured.plans) / max(1, pairs)


def _beyond_answers(found: dict[str, float | None], whole: Cell, time: str) -> list[str]:
    """Which figures stand for requests that were never answered, so that they are lower bounds."""
    failed: Histogram = getattr(whole, f"failed_{time}")
    answered: Histogram = getattr(whole, time)
    if not failed.total:
        return []
    share = answered.total / (answered.total + failed.total)
    names = [name for name, quantile in SHARES.items() if found[name] is not None and quantile > share]
    return ["mean", *names, "max"]


def series(measured: Measured, sizes: dict[SeriesName, tuple[int, int]]) -> list[dict[str, Any]]:
    """The `series` of latency.json; `sizes` are octets of request and response, as seen before the run."""
    return [_one_series(measured, name, *sizes.get(name, (None, None))) for name in measured.plan.series_names()]


def _one_series(measured: Measured, name: SeriesName, request: int | None, response: int | None) -> dict[str, Any]:
    whole = measured.total("duel", name)
    spans = measured.spans("duel", name)
    times = {time: measured.whole(name, time) for time in ("service", "response")}
    service, reasons = quantiles(times["service"])
    responses = plain_quantiles(times["response"])
    intervals: dict[str, dict[str, Any]] = {"service": {}, "response": {}}
    rounds: dict[str, Any] = {}
    for time, kept in intervals.items():
        units = measured.units(name, time)
        for quantile in ("p50", "p99"):
            estimate = figure_interval_ms(units, quantile, measured.plan.load.seed)
            kept[quantile] = rounded_interval(estimate.interval)
            if estimate.reason:
                reasons[f"ci95 {quantile}"] = estimate.reason
            if time == "service":
                rounds[quantile] = rounds_of(estimate.replicates, pair_s(measured, "duel", name))
    return named(name) | {
        "count": whole.service.total,
        "errors": whole.errors,
        "late": whole.late,
        "dropped": whole.dropped,
        "counted": times["service"].total,
        "at_least": _beyond_answers(service, whole, "service"),
        "service_ms": service,
        "response_ms": responses,
        "ci95_ms": intervals["service"],
        "response_ci95_ms": intervals["response"],
        "rounds": rounds,
        "repeats": _repeats(measured, name),
        "spans_ms": {
            part: plain_quantiles(getattr(spans, part)) if getattr(spans, part).total else None
            for part in ("build", "wire", "server", "parse")
        },
        "reasons": reasons,
        "request_bytes": request,
        "response_bytes": response,
        "histogram": whole.service.encode(),
        "response_histogram": whole.response.encode(),
        "failed_histogram": whole.failed_service.encode() if whole.failed_service.total else None,
        "failed_response_histogram": whole.failed_response.encode() if whole.failed_response.total else None,
    }


def _repeats(measured: Measured, name: SeriesName) -> list[dict[str, Any]]:
    """The service time's figures of each repeat alone; empty where there was one run."""
    if len(measured.plans) == 1:
        return []
    found = []
    for plan in measured.plans:
        units = [unit for unit in measured.units(name, "service") if unit.repeat == plan.repeat]
        whole = Histogram()
        for unit in units:
            whole.merge(unit.sides[0])
        figures = plain_quantiles(whole)
        intervals = {q: figure_interval_ms(units, q, plan.load.seed).interval for q in ("p50", "p99")}
        found.append(
            {"repeat": plan.repeat, "count": whole.total}
            | {q: figures[q] for q in intervals}
            | {"ci95_ms": {q: rounded_interval(interval) for q, interval in intervals.items()}}
        )
    return found


def comparisons(measured: Measured, deviation: float) -> list[dict[str, Any]]:
    """SOAP against REST, by operation, client and quantile, over the service time, judged by the A/A run.

    The library clients have no A/A run of their own: the wire client's judges them too. `deviation` is the relative
    standard deviation of the ratio between runs, as far as this run cannot see it.
    """
    found: list[dict[str, Any]] = []
    if measured.plan.robots > 1:
        return found  # robots took turns, not interfaces
    names = set(measured.plan.series_names())
    for operation in measured.plan.operations:
        clients = [
            client
            for client in measured.plan.clients
            if all((operation, interface, client) in names for interface in _COMPARED_INTERFACES)
        ]
        floor = {quantile: noise(measured, operation, quantile) for quantile in COMPARED} if clients else {}
        found += [
            comparison(measured, operation, client, quantile, floor[quantile], deviation)
            for client in clients
            for quantile in COMPARED
        ]
    return found


def comparison(
    measured: Measured, operation: str, client: str, quantile: str, floor: Interval | None, deviation: float
) -> dict[str, Any]:
    """SOAP against REST at one quantile, judged by the interval that an interface came to against itself."""
    rest, soap = (Side("duel", (operation, interface, client)) for interface in _COMPARED_INTERFACES)
    length = pair_s(measured, "duel", rest.name)
    entry = compared(measured.paired(rest, soap), quantile, measured, "soap_minus_rest_ms", length, deviation)
    verdict = judge(entry["ratio"], entry["ci95"], floor) if entry["ratio"] is not None else Judgement("none")
    return (
        {"operation": operation, "client": client}
        | entry
        | {
            "between_runs": rounded(deviation),
            "noise_ci95": rounded_interval(floor),
            "judgement": verdict.verdict,
            "bound": rounded(verdict.bound),
            "judgement_reason": verdict.reason or entry["reason"],
        }
    )


def noise(measured: Measured, operation: str, quantile: str) -> Interval | None:
    """The ratio that SOAP and REST came to against themselves, both together: its interval."""
    client = measured.plan.clients[0]
    parts = []
    for stream, interface in enumerate(_COMPARED_INTERFACES):
        name = (operation, interface, client)
        if name in measured.plan.series_names():
            parts.append(_enough(_against_itself(measured, name), quantile, measured.plan.load.seed, stream=stream))
    known = [part for part in parts if part is not None]
    return pooled_interval(known) if len(known) == len(parts) else None


def _against_itself(measured: Measured, name: SeriesName) -> list[Unit]:
    return measured.paired(Side("aa", name, "a"), Side("aa", name, "b"))


def noise_floor(measured: Measured) -> list[dict[str, Any]]:
    """A/A: each interface against itself."""
    found: list[dict[str, Any]] = []
    client = measured.plan.clients[0]
    for interface in measured.plan.interfaces:
        for number in measured.plan.offered(interface, client):
            name = (measured.plan.operations[number], interface, client)
            units, length = _against_itself(measured, name), pair_s(measured, "aa", name)
            found += [
                named(name) | compared(units, quantile, measured, "difference_ms", length) for quantile in COMPARED
            ]
    return found


def _samples(units: list[Unit]) -> int:
    """How many the side with fewer has."""
    return min((sum(unit.sides[side].total for unit in units) for side in (0, 1)), default=0)


def _needed(quantile: str) -> int:
    return 2 if quantile == "mean" else samples_for_point(SHARES[quantile])


def _enough(units: list[Unit], quantile: str, seed: int, *, stream: int = 0, deviation: float = 0.0) -> Compared | None:
    """Compare two sides where both have enough samples."""
    enough = _samples(units) >= _needed(quantile)
    return compare(units, quantile, seed, stream=stream, deviation=deviation) if enough else None


def compared(
    units: list[Unit], quantile: str, measured: Measured, difference: str, pair_s: float, deviation: float = 0.0
) -> dict[str, Any]:
    """Two sides at one quantile: what latency.json says, `difference` being its key; `deviation` as in `compare`."""
    result = _enough(units, quantile, measured.plan.load.seed, deviation=deviation)
    reason = None
    if result is None:
        reason = f"{_samples(units)} samples on one side; {quantile} needs {_needed(quantile)}"
    elif result.ci95 is None:
        reason = f"no interval: fewer than {LEAST_ROUNDS} rounds of blocks"
    return {
        "quantile": quantile,
        difference: rounded(result.difference_ms) if result else None,
        "ratio": rounded(result.ratio) if result else None,
        "ci95": rounded_interval(result.ci95) if result else None,
        "ci95_difference_ms": rounded_interval(result.ci95_difference_ms) if result else None,
        "rounds": rounds_of(result.replicates, pair_s) if result else None,
        "reason": reason,
    }
