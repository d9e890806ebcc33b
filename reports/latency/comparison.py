"""Did it get slower? Two latency results, compared quantile by quantile with an interval and a noise threshold.

For each series that both results hold, the ratio new / old of the median and of the 99th percentile gets an
interval from the two intervals that the results carry (which come from resampled blocks): on the logarithmic
scale, where a ratio is a difference, by the method of variance estimates recovery (Zou and Donner, Statistics
in Medicine 27, 2008). The more quantiles are looked at, the likelier is one of them to look slower by chance:
the intervals are widened so that all of them hold together at 95 % (Bonferroni).

A change counts only where its whole interval lies beyond the threshold: the greater of what was asked for and
of what either result measured of an interface against itself. Two runs differ for more reasons than one run's
blocks do, and that is what the threshold is there for. A response time also carries the generator's own lag;
a difference that is no greater than that lag is none of the robot's.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

from reports.errors import ResultsIncompatibleError
from reports.latency.distributions import Series, all_series
from reports.latency.numbers import rate

QUANTILES = ("p50", "p99")
_ASCENDING = ("p50", "p90", "p99")
_CONFIDENCE = 0.95
TIMES = {"service": ("service_ms", "ci95_ms"), "response": ("response_ms", "response_ci95_ms")}
_SAME_RATE = 0.02
"""Rates that differ by less than this share count as one."""


@dataclass(frozen=True, slots=True)
class Change:
    """One quantile of one series in both results.

    Attributes:
        time: "service" or "response".
        quantile: "p50" or "p99".
        old_ms, new_ms: the values; None where that run supports none.
        ratio: new / old.
        interval: the ratio's interval; those of all changes hold together at 95 %.
        threshold: the share by which it has to change to count, 0.05 for 5 %.
        lag_ms: the generator's own lag at the quantile, which is in a response time; 0 for a service time.
        verdict: "slower", "faster", "same", "unclear" (the interval lies neither beyond the threshold nor within the
            one that was asked for) or "no figure".
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
        """What the page calls the series."""
        return f"{self.operation}, {self.interface.upper()}, {self.client}"


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two results and what changed between them.

    Attributes:
        changes: one for each series, time and quantile that both hold.
        remarks: what else a reader has to know: other machine, more errors, series that only one result holds.
    """

    old: Mapping[str, Any]
    new: Mapping[str, Any]
    old_series: Mapping[tuple[str, str, str], Series]
    new_series: Mapping[tuple[str, str, str], Series]
    changes: tuple[Change, ...]
    remarks: tuple[str, ...]

    @property
    def valid(self) -> bool:
        """Whether both measurements say something, and at least one quantile could be compared."""
        return bool(self.old["valid"] and self.new["valid"] and any(c.interval for c in self.changes))

    def with_verdict(self, verdict: str) -> list[Change]:
        """Changes of that verdict, the greatest first."""
        found = [change for change in self.changes if change.verdict == verdict]
        return sorted(found, key=lambda change: -abs(math.log(change.ratio or 1.0)))

    @property
    def slower(self) -> bool:
        """Whether anything got slower beyond its threshold."""
        return bool(self.with_verdict("slower"))


def compare(old: Mapping[str, Any], new: Mapping[str, Any], names: tuple[str, str], threshold: float) -> Comparison:
    """Compare two valid `roaas-latency/1` documents; `threshold` is a share, 0.05 for 5 %, and `names` are their paths.

    Raises:
        ResultsIncompatibleError: they were measured under different loads, or have no series in common.
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
    drafts = [
        replace(change, lag_ms=lag[change.quantile] if change.time == "response" else 0.0)
        for key in common
        for change in _changes(old_series[key], new_series[key], noise, threshold)
    ]
    together = sum(change.interval is not None for change in drafts)
    changes = tuple(_settled(change, together, threshold) for change in drafts)
    return Comparison(old, new, old_series, new_series, changes, tuple(_remarks(old, new, old_series, new_series)))


def _same_load(old: Mapping[str, Any], new: Mapping[str, Any], names: tuple[str, str]) -> None:
    if old["model"] != new["model"]:
        raise ResultsIncompatibleError(
            f"{names[0]} measured in the {old['model']} model and {names[1]} in the {new['model']} one: "
            "their times mean different things"
        )
    if old.get("users") != new.get("users"):
        raise ResultsIncompatibleError(
            f"{names[0]} measured with {old.get('users')} users and {names[1]} with {new.get('users')}"
        )
    _same_cap(old, new, names)
    before, after = old.get("rate"), new.get("rate")
    if (before is None) != (after is None) or (
        before is not None and after is not None and abs(after - before) > _SAME_RATE * max(before, after)
    ):
        raise ResultsIncompatibleError(
            f"{names[0]} measured at {rate(before)} requests/s and {names[1]} at {rate(after)}: "
            "only what ran under the same load can be compared"
        )


def _same_cap(old: Mapping[str, Any], new: Mapping[str, Any], names: tuple[str, str]) -> None:
    """A closed model under a cap measures the cap as well; in the open one the rate is what it is."""
    caps = [(plan.get("limits") or {}).get("max_rate") for plan in (old, new)]
    if new["model"] == "closed" and caps[0] != caps[1]:
        told = [f"a cap of {rate(cap)} requests/s" if cap is not None else "no cap" for cap in caps]
        raise ResultsIncompatibleError(
            f"{names[0]} measured under {told[0]} and {names[1]} under {told[1]}: users that are held back wait for "
            "the cap, not for the robot; measure both under the same [load] max_rate"
        )


def _changes(old: Series, new: Series, noise: Sequence[Mapping[str, Any]], threshold: float) -> Iterator[Change]:
    for time, (values, bounds) in TIMES.items():
        if time == "response" and new.data[values] == new.data["service_ms"]:
            continue  # the closed model: both are one time
        for quantile in QUANTILES:
            before, after = old.data[values].get(quantile), new.data[values].get(quantile)
            intervals = (old.data.get(bounds, {}).get(quantile), new.data.get(bounds, {}).get(quantile))
            limit = max(threshold, noise_of(noise, new, quantile))
            ratio = after / before if before and after is not None else None
            interval = ratio_interval(before, intervals[0], after, intervals[1])
            operation, client, interface = new.key
            yield Change(operation, interface, client, time, quantile, before, after, ratio, interval, limit)


def _settled(change: Change, together: int, asked: float) -> Change:
    """Widen a change's interval so that `together` of them hold at once, and judge it."""
    if change.interval is None or change.ratio is None or change.old_ms is None or change.new_ms is None:
        return change
    interval = widened(change.ratio, change.interval, together)
    verdict = judge(interval, change.threshold, asked)
    if verdict in {"slower", "faster"} and abs(change.new_ms - change.old_ms) <= change.lag_ms:
        verdict = "unclear"
    return replace(change, interval=interval, verdict=verdict)


def widened(ratio: float, interval: tuple[float, float], together: int) -> tuple[float, float]:
    """The interval of one ratio of many at the confidence at which all of them hold together, normal on a log scale."""
    alone, all_of_them = (NormalDist().inv_cdf(1 - (1 - _CONFIDENCE) / 2 / count) for count in (1, together))
    factor = all_of_them / alone
    low, high = (math.log(bound / ratio) * factor for bound in interval)
    return ratio * math.exp(low), ratio * math.exp(high)


def _lag(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, float]:
    lags = [result.get("generator", {}).get("lag_ms") or {} for result in (old, new)]
    return {quantile: max(lag.get(quantile) or 0.0 for lag in lags) for quantile in QUANTILES}


def noise_of(noise: Sequence[Mapping[str, Any]], series: Series, quantile: str) -> float:
    """How far an interface's ratio to itself may lie from 1: the farthest bound measured for these; 0 if none was.

    A higher quantile is never the steadier one: it takes the noise of the lower ones where its own is not
    known.
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
    """The 95 % interval of new / old from the intervals of both; None where one of the four is missing or not above 0.

    With log ratio d and arms a of each estimate: d - sqrt(a_new_low² + a_old_high²), d + sqrt(a_new_high² +
    a_old_low²).
    """
    if old is None or new is None or old_bounds is None or new_bounds is None:
        return None
    if min(old, new, *old_bounds, *new_bounds) <= 0:
        return None
    change = math.log(new / old)
    # A skewed bootstrap may leave the estimate outside of its own interval: an arm is never negative.
    new_low, new_high = (max(0.0, math.log(new / new_bounds[0])), max(0.0, math.log(new_bounds[1] / new)))
    old_low, old_high = (max(0.0, math.log(old / old_bounds[0])), max(0.0, math.log(old_bounds[1] / old)))
    return math.exp(change - math.hypot(new_low, old_high)), math.exp(change + math.hypot(new_high, old_low))


def judge(interval: tuple[float, float], threshold: float, asked: float) -> str:
    """What an interval of new / old says.

    Beyond the share `threshold` a change is none of the noise's; within `asked`, which no noise makes greater, there
    is none worth a word.
    """
    low, high = interval
    if low > 1 + threshold:
        return "slower"
    if high < 1 / (1 + threshold):
        return "faster"
    return "same" if low >= 1 / (1 + asked) and high <= 1 + asked else "unclear"


def _remarks(
    old: Mapping[str, Any],
    new: Mapping[str, Any],
    old_series: Mapping[tuple[str, str, str], Series],
    new_series: Mapping[tuple[str, str, str], Series],
) -> Iterator[str]:
    for word, result in (("old", old), ("new", new)):
        if not result["valid"]:
            yield f"The {word} result is not valid: {'; '.join(result['invalid_because'])}."
    for key in ("cpu", "cpus", "kernel", "python"):
        before, after = old["environment"][key], new["environment"][key]
        if before != after:
            yield f"Measured on different machines or systems: {key} was {before}, and is {after}."
    for word, series, other in (("old", old_series, new_series), ("new", new_series, old_series)):
        alone = [f"{one.name} ({one.data['client']})" for key, one in series.items() if key not in other]
        if alone:
            yield f"Only in the {word} result: {', '.join(alone)}."
    before, after = (_failed(series) for series in (old_series, new_series))
    if after > before:
        yield f"More requests failed: {after:.2%} instead of {before:.2%}."
    yield from _uncounted(old_series, new_series)
    for interface, (was, now) in _knees(old, new).items():
        if was != now:
            yield f"{interface.upper()} held up to {rate(was)} requests/s, and now holds up to {rate(now)}."


def _uncounted(
    old_series: Mapping[tuple[str, str, str], Series], new_series: Mapping[tuple[str, str, str], Series]
) -> Iterator[str]:
    for word, series in (("old", old_series), ("new", new_series)):
        if any(one.data["errors"] and "counted" not in one.data for one in series.values()):
            yield f"In the {word} result, of an earlier version, failed requests are in no figure of time."


def _failed(series: Mapping[tuple[str, str, str], Series]) -> float:
    failed = sum(int(one.data["errors"]) for one in series.values())
    return failed / max(1, failed + sum(int(one.data["count"]) for one in series.values()))


def _knees(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, tuple[float | None, float | None]]:
    before, after = (
        {knee["interface"]: knee["highest_rate"] for knee in result.get("knee", [])} for result in (old, new)
    )
    return {interface: (before[interface], after[interface]) for interface in after if interface in before}
