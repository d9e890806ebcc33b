"""Compare two latency results quantile by quantile with a confidence interval and a threshold.

For each series that both results hold, the ratio new / old of the median and of the 99th percentile gets an interval.
It is computed from the intervals in the two results (which come from resampled blocks) on the logarithmic scale, by the
method of variance estimates recovery (Zou and Donner, Statistics in Medicine 27, 2008). With many quantiles one of them
looks slower by chance, so the intervals are widened until they hold simultaneously at 95 % (Bonferroni).

A change counts only if its whole interval is beyond the threshold. The threshold is the greater of the given threshold
and of the A/A control's deviation in either result, because two runs differ more than the blocks of one run do. A
response time includes the load generator's own lag, so a difference smaller than that lag is not the robot's.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

from reports.errors import ResultsIncompatibleError
from reports.latency.distributions import AllSeries, Series, all_series
from reports.latency.numbers import rate

QUANTILES = ("p50", "p99")
#: Share by which a quantile must change to count where one run met a busy machine: equal p99s were 50 times apart.
_BUSY = {"p50": 1.0, "p99": 99.0}
_ASCENDING = ("p50", "p90", "p99")
_CONFIDENCE = 0.95
TIMES = {"service": ("service_ms", "ci95_ms"), "response": ("response_ms", "response_ci95_ms")}
_SAME_RATE = 0.02
"""Rates that differ by less than this share count as equal."""


@dataclass(frozen=True, slots=True)
class Change:
    """The comparison of one quantile of one series in both results.

    Attributes:
        time: "service" or "response".
        quantile: "p50" or "p99".
        old_ms, new_ms: the values; None if that run has too few requests for one.
        ratio: new / old.
        interval: the ratio's interval; the intervals of all changes hold simultaneously at 95 %.
        threshold: the share by which the value must change to count, 0.05 for 5 %.
        lag_ms: the generator's own lag at the quantile, which a response time includes; 0 for a service time.
        verdict: "slower", "faster", "same", "unclear" (the interval is neither beyond `threshold` nor within the
            threshold that the user gave), "no figure", or "not compared" where a result is not valid.
    """

    operation: str
    interface: str
    client: str
    time: str
    quantile: str
    old_ms: float | None
    new_ms: float | None
    ratio: float | None
    interval: tuple[float, float] | None
    threshold: float
    lag_ms: float = 0.0
    verdict: str = "no figure"

    @property
    def series(self) -> str:
        """Return the series' name as pages show it: operation, interface and client."""
        return f"{self.operation}, {self.interface.upper()}, {self.client}"


@dataclass(frozen=True, slots=True)
class Comparison:
    """The comparison of an old and a new latency result.

    Attributes:
        changes: one for each series, time and quantile in both results.
        remarks: other differences: another machine, more errors, series that only one result holds.
    """

    old: Mapping[str, Any]
    new: Mapping[str, Any]
    old_series: AllSeries
    new_series: AllSeries
    changes: tuple[Change, ...]
    remarks: tuple[str, ...]

    @property
    def valid(self) -> bool:
        """Return whether both results are valid and at least one quantile could be compared."""
        return bool(self.old["valid"] and self.new["valid"] and any(c.interval for c in self.changes))

    def with_verdict(self, verdict: str) -> list[Change]:
        """Return the changes with that verdict, the one first that is known best.

        That is the one with the least uncertainty: its interval, and what the A/A controls show to be noise.
        """
        return sorted((change for change in self.changes if change.verdict == verdict), key=_uncertainty)

    @property
    def busy(self) -> str:
        """Return what to do where a machine was busy; empty where none was."""
        for word, result in (("old", self.old), ("new", self.new)):
            if load := _busy_load(result):
                return (
                    f"The machine was busy before the {word} run (load average {load:.1f} on "
                    f"{result['environment']['cpus']} CPUs), and two runs meet different disturbances. So a median "
                    "counts only if it doubles, a p99 only if it grows a hundredfold. To be sure, measure both "
                    "versions in one run with roaas load --against."
                )
        return ""

    @property
    def slower(self) -> bool:
        """Return whether any quantile got slower beyond its threshold."""
        return bool(self.with_verdict("slower"))


def _busy_load(result: Mapping[str, Any]) -> float | None:
    """Return the load average before a run that found the machine busy."""
    load: float | None = (result["environment"].get("machine") or {}).get("load_average_before")
    return load if load is not None and load > result["environment"]["cpus"] else None


def _uncertainty(change: Change) -> tuple[float, float]:
    low, high = change.interval or (1.0, math.inf)
    return max(math.log(high / low), math.log1p(change.threshold)), math.log(high / low)


def compare(old: Mapping[str, Any], new: Mapping[str, Any], names: tuple[str, str], threshold: float) -> Comparison:
    """Compare two valid `roaas-latency/1` documents quantile by quantile.

    `threshold` is the share by which a quantile must change to count, 0.05 for 5 %; `names` are the documents' paths.

    Raises:
        ResultsIncompatibleError: the results were measured under different loads, or share no series.
        ResultInvalidError: a histogram cannot be decoded.
    """
    _same_load(old["plan"], new["plan"], names)
    old_series, new_series = all_series(old, names[0]), all_series(new, names[1])
    common = [key for key in new_series if key in old_series]
    if not common:
        held = " and ".join(
            f"{name}: {'; '.join(', '.join(key) for key in series) or 'none'}"
            for name, series in zip(names, (old_series, new_series), strict=True)
        )
        raise ResultsIncompatibleError(f"the two results have no series in common ({held})")
    noise = [*old.get("noise_floor", []), *new.get("noise_floor", [])]
    lag = _lag(old, new)
    busy = _busy_load(old) or _busy_load(new)
    least = {quantile: max(threshold, _BUSY[quantile] if busy else 0.0) for quantile in QUANTILES}
    drafts = [
        replace(change, lag_ms=lag[change.quantile] if change.time == "response" else 0.0)
        for key in common
        for change in _changes(old_series[key], new_series[key], noise, least)
    ]
    together = sum(change.interval is not None for change in drafts)
    changes = tuple(_settle(change, together, threshold) for change in drafts)
    if not (old["valid"] and new["valid"]):
        changes = tuple(replace(change, verdict="not compared") for change in changes)
    return Comparison(old, new, old_series, new_series, changes, tuple(_remarks(old, new, old_series, new_series)))


def _same_load(old: Mapping[str, Any], new: Mapping[str, Any], names: tuple[str, str]) -> None:
    if old["model"] != new["model"]:
        raise ResultsIncompatibleError(
            f"{names[0]} was measured in the {old['model']} model and {names[1]} in the {new['model']} model: "
            "their times mean different things"
        )
    if old.get("users") != new.get("users"):
        raise ResultsIncompatibleError(
            f"{names[0]} was measured with {old.get('users')} users and {names[1]} with {new.get('users')}"
        )
    _same_cap(old, new, names)
    if (old.get("stages") or []) != (new.get("stages") or []):
        raise ResultsIncompatibleError(f"{names[0]} and {names[1]} were measured with different stages")
    scenarios = [plan.get("scenario") for plan in (old, new)]
    if scenarios[0] != scenarios[1]:
        raise ResultsIncompatibleError(f"{names[0]} and {names[1]} were measured with different scenarios")
    before, after = old.get("rate"), new.get("rate")
    if (before is None) != (after is None) or (
        before is not None and after is not None and abs(after - before) > _SAME_RATE * max(before, after)
    ):
        raise ResultsIncompatibleError(
            f"{names[0]} was measured at {rate(before)} requests/s and {names[1]} at {rate(after)}: "
            "only results under the same load can be compared"
        )


def _same_cap(old: Mapping[str, Any], new: Mapping[str, Any], names: tuple[str, str]) -> None:
    """Raise `ResultsIncompatibleError` for two closed-model results with different caps on the request rate.

    Times under a cap include waiting for the cap.
    """
    caps = [(plan.get("limits") or {}).get("max_rate") for plan in (old, new)]
    if new["model"] == "closed" and caps[0] != caps[1]:
        limits = [f"a cap of {rate(cap)} requests/s" if cap is not None else "no cap" for cap in caps]
        raise ResultsIncompatibleError(
            f"{names[0]} was measured under {limits[0]} and {names[1]} under {limits[1]}: throttled users wait for the "
            "cap and not for the robot. Measure both under the same [load] max_rate."
        )


def _changes(
    old: Series, new: Series, noise: Sequence[Mapping[str, Any]], least: Mapping[str, float]
) -> Iterator[Change]:
    for time, (values, bounds) in TIMES.items():
        if time == "response" and new.data[values] == new.data["service_ms"]:
            continue  # in the closed model both times are the same
        for quantile in QUANTILES:
            before, after = old.data[values].get(quantile), new.data[values].get(quantile)
            intervals = (old.data.get(bounds, {}).get(quantile), new.data.get(bounds, {}).get(quantile))
            limit = max(least[quantile], noise_of(noise, new, quantile))
            ratio = after / before if before and after is not None else None
            interval = ratio_interval(before, intervals[0], after, intervals[1])
            operation, client, interface = new.key
            yield Change(operation, interface, client, time, quantile, before, after, ratio, interval, limit)


def _settle(change: Change, together: int, asked: float) -> Change:
    """Widen a change's interval so that `together` intervals hold simultaneously, and set its verdict.

    `asked` is the threshold that the user gave.
    """
    if change.interval is None or change.ratio is None or change.old_ms is None or change.new_ms is None:
        return change
    interval = widened(change.ratio, change.interval, together)
    verdict = judge(interval, change.threshold, asked)
    if verdict in {"slower", "faster"} and abs(change.new_ms - change.old_ms) <= change.lag_ms:
        verdict = "unclear"
    return replace(change, interval=interval, verdict=verdict)


def widened(ratio: float, interval: tuple[float, float], together: int) -> tuple[float, float]:
    """Return a 95 % interval of a ratio, widened so that `together` such intervals hold simultaneously.

    The method is Bonferroni's, with a normal distribution on the log scale.
    """
    alone, all_of_them = (NormalDist().inv_cdf(1 - (1 - _CONFIDENCE) / 2 / count) for count in (1, together))
    factor = all_of_them / alone
    low, high = (math.log(bound / ratio) * factor for bound in interval)
    return ratio * math.exp(low), ratio * math.exp(high)


def _lag(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, float]:
    lags = [result.get("generator", {}).get("lag_ms") or {} for result in (old, new)]
    return {quantile: max(lag.get(quantile) or 0.0 for lag in lags) for quantile in QUANTILES}


def noise_of(noise: Sequence[Mapping[str, Any]], series: Series, quantile: str) -> float:
    """Return how far the A/A control's ratio differs from 1, as a share; 0 if no control was measured.

    The deviation of a quantile is at least that of the lower quantiles, also if its own was not measured.
    """
    lower = _ASCENDING[: _ASCENDING.index(quantile) + 1]
    operation, client, _ = series.key
    bounds = [
        bound
        for entry in noise
        if (entry["operation"], entry["client"]) == (operation, client) and entry["quantile"] in lower
        for bound in entry["ci95"] or ()
        if bound > 0
    ]
    return max((max(bound, 1 / bound) - 1 for bound in bounds), default=0.0)


def ratio_interval(
    old: float | None, old_bounds: Sequence[float] | None, new: float | None, new_bounds: Sequence[float] | None
) -> tuple[float, float] | None:
    """Return the 95 % interval of new / old from both values' intervals; None if a value is missing or not above 0.

    With log ratio d and arms a of each estimate: d - sqrt(a_new_low² + a_old_high²), d + sqrt(a_new_high² +
    a_old_low²).
    """
    if old is None or new is None or old_bounds is None or new_bounds is None:
        return None
    if min(old, new, *old_bounds, *new_bounds) <= 0:
        return None
    change = math.log(new / old)
    # With a skewed bootstrap the estimate may lie outside its own interval; an arm must not be negative.
    new_low, new_high = (max(0.0, math.log(new / new_bounds[0])), max(0.0, math.log(new_bounds[1] / new)))
    old_low, old_high = (max(0.0, math.log(old / old_bounds[0])), max(0.0, math.log(old_bounds[1] / old)))
    return math.exp(change - math.hypot(new_low, old_high)), math.exp(change + math.hypot(new_high, old_low))


def judge(interval: tuple[float, float], threshold: float, asked: float) -> str:
    """Return "slower", "faster", "same" or "unclear" for an interval of new / old.

    "slower" and "faster" need the whole interval beyond `threshold`, which includes the A/A control's deviation. "same"
    needs the whole interval within `asked`, the threshold that the user gave.
    """
    low, high = interval
    if low > 1 + threshold:
        return "slower"
    if high < 1 / (1 + threshold):
        return "faster"
    return "same" if low >= 1 / (1 + asked) and high <= 1 + asked else "unclear"


def _remarks(
    old: Mapping[str, Any], new: Mapping[str, Any], old_series: AllSeries, new_series: AllSeries
) -> Iterator[str]:
    for word, result in (("old", old), ("new", new)):
        if not result["valid"]:
            yield f"The {word} result is not valid: {'; '.join(result['invalid_because'])}."
    for key in ("cpu", "cpus", "kernel", "python"):
        before, after = old["environment"][key], new["environment"][key]
        if before != after:
            yield f"The two were measured on different machines or systems: {key} was {before}, and is {after}."
    for word, series, other in (("old", old_series, new_series), ("new", new_series, old_series)):
        alone = [f"{one.name} ({one.data['client']})" for key, one in series.items() if key not in other]
        if alone:
            yield f"Only in the {word} result: {', '.join(alone)}."
    before, after = (_failed_share(series) for series in (old_series, new_series))
    if after > before:
        yield f"More requests failed: {after:.2%} now, {before:.2%} before."
    yield from _knees(old, new)


def _failed_share(series: AllSeries) -> float:
    failed = sum(int(one.data["errors"]) for one in series.values())
    return failed / max(1, failed + sum(int(one.data["count"]) for one in series.values()))


def _knees(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield a remark for each interface whose knee moved: the regions in which it lies do not overlap."""
    before, after = (
        {search["interface"]: search for search in result.get("knee_search", []) if search["interval"]}
        for result in (old, new)
    )
    for interface in (name for name in after if name in before):
        was, now = before[interface], after[interface]
        if max(was["interval"][0], now["interval"][0]) > min(was["interval"][1], now["interval"][1]):
            yield (
                f"{interface.upper()}: the knee was at {rate(was['rate'])} requests/s, and is now at "
                f"{rate(now['rate'])}."
            )
