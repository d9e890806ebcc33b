"""Judge service levels: kept, broken, or not known at 95 % confidence.

A limit on a quantile is a limit on a share: p99 is at most 50 ms where at most 1 % of the requests take longer. So a
quantile and an error rate are judged alike, by the exact interval of a share (Clopper and Pearson, Biometrika 26,
1934). Slow and failed requests come in bursts, which say less than as many single ones: the number of requests is
divided by how much more their share varies over the run than chance explains (Pearson's dispersion; Rao and Scott,
Biometrics 48, 1992). All measured requests count, those of the A/A control too.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import msgspec
import numpy as np
from scipy import special

from conformance.statement.load import ServiceLevel
from loadtests.schedule.plan import SeriesName
from loadtests.schedule.plan import share as share_of_requests
from loadtests.statistics.figures import quantiles, rounded, rounded_interval
from loadtests.statistics.histogram import SHARES, Floats, Histogram, edges_us
from loadtests.statistics.measured import Block, Measured, counted_times
from loadtests.statistics.rounds import Interval

KEPT, BROKEN, NOT_KNOWN = "kept", "broken", "not known"
_PHASES = ("duel", "aa")
_TAIL = 0.025
_SAME_RATE = 0.02
_FEWEST_GROUPS = 10
_ERRORS = "error_rate"


class Level(msgspec.Struct, kw_only=True):
    """One limit of a service level on one series: an entry of `slo` in latency.json.

    Attributes:
        limit: `p99_ms`, or another quantile of the response time, or `error_rate`.
        most: the value that it may have.
        at_rate: requests per second at which it holds, or None.
        rate: requests per second at which it was measured.
        measured: the value in this run; None without enough requests for one.
        requests: how many requests it is judged by.
        beyond: how many of them failed, or took longer than `most`.
        share_ci95: 95 % interval of their share.
        share_allowed: the share that the limit allows.
        reason: the outcome in words.
    """

    operation: str
    interface: str
    client: str
    limit: str
    most: float
    at_rate: float | None
    rate: float | None
    measured: float | None
    requests: int
    beyond: int
    share_ci95: list[float] | None
    share_allowed: float
    outcome: str
    reason: str


def levels(measured: Measured, wanted: Mapping[str, ServiceLevel]) -> list[Level]:
    """Return the `slo` of latency.json: each limit on each series of its operation, over the leading client."""
    return [
        _level(measured, name, limit, most, wanted[name[0]].at_rate)
        for name in measured.plan.series_names()
        if name[0] in wanted and name[2] == measured.plan.clients[0]
        for limit, most in wanted[name[0]].limits.items()
    ]


def _level(measured: Measured, name: SeriesName, limit: str, most: float, at_rate: float | None) -> Level:
    blocks = list(measured.blocks(name, *_PHASES))
    whole = Histogram.sum_of(counted_times(block.cell, "response") for block in blocks)
    if limit == _ERRORS:
        allowed, counts = most, [(block.cell.errors + block.cell.dropped, _requests(block)) for block in blocks]
        value = sum(failed for failed, _ in counts) / whole.total if whole.total else None
    else:
        quantile = limit.removesuffix("_ms")
        allowed, value = 1 - SHARES[quantile], quantiles(whole)[0][quantile]
        floor = max((block.cell.response.highest_ns for block in blocks), default=0)
        counts = [(_above(counted_times(block.cell, "response", floor), most), _requests(block)) for block in blocks]
    beyond, interval = sum(count for count, _ in counts), share_interval(counts)
    rate = _rate(measured, name, blocks)
    outcome, why = _outcome(interval, allowed, rate, at_rate)
    return Level(
        operation=name[0],
        interface=name[1],
        client=name[2],
        limit=limit,
        most=most,
        at_rate=at_rate,
        rate=rounded(rate),
        measured=rounded(value),
        requests=whole.total,
        beyond=beyond,
        share_ci95=rounded_interval(interval),
        share_allowed=round(allowed, 6),
        outcome=outcome,
        reason=f"{_words(limit, most, beyond, whole.total, interval, allowed)}{why}",
    )


def _requests(block: Block) -> int:
    return block.cell.response.total + block.cell.failed_response.total


def _above(histogram: Histogram, most_ms: float) -> int:
    bins, counts = histogram.arrays()
    return int(counts[edges_us(bins)[0] >= most_ms * 1e3].sum())


def _rate(measured: Measured, name: SeriesName, blocks: Sequence[Block]) -> float | None:
    """Return the requests per second of a series: as scheduled, or in the closed model as sent."""
    plan = measured.plan
    if plan.load.rate is not None and not plan.load.stages:
        offered = len(plan.choices(name[1], name[2]))
        return plan.load.rate * share_of_requests(plan.operations.index(name[0]), plan.weights, offered)
    seconds = sum(block.segment.active_s for block in blocks)
    return sum(map(_requests, blocks)) / seconds if seconds else None


def share_interval(counts: Iterable[tuple[int, int]]) -> Interval | None:
    """Return the 95 % interval of a share; None without requests.

    Args:
        counts: for each block, in order of time: how many requests count, of how many.
    """
    table = np.array([pair for pair in counts if pair[1]], dtype=np.float64).reshape(-1, 2)
    found, total = (float(value) for value in table.sum(axis=0))
    if not total:
        return None
    spread = _dispersion(table)
    found, total = found / spread, total / spread
    low = float(special.betaincinv(found, total - found + 1, _TAIL)) if found else 0.0
    high = float(special.betaincinv(found + 1, total - found, 1 - _TAIL)) if found < total else 1.0
    return low, high


def _dispersion(table: Floats) -> float:
    """Return how many times as much the share varies between stretches of the run as chance explains, 1 or more.

    The stretches are one block, two, four and so on: bursts may be longer than a block.
    """
    share = table[:, 0].sum() / table[:, 1].sum()
    if not 0 < share < 1:
        return 1.0
    return max([1.0, *_dispersions(table, float(share))])


def _dispersions(table: Floats, share: float) -> Iterator[float]:
    while len(table) >= _FEWEST_GROUPS:
        expected = table[:, 1] * share
        yield float(((table[:, 0] - expected) ** 2 / (expected * (1 - share))).sum() / (len(table) - 1))
        even = table[: len(table) // 2 * 2]
        table = even[::2] + even[1::2]


def _outcome(interval: Interval | None, allowed: float, rate: float | None, at_rate: float | None) -> tuple[str, str]:
    """Return the outcome, and an addition to its reason."""
    if interval is None or rate is None:
        return NOT_KNOWN, ""
    if interval[1] <= allowed:
        if at_rate is not None and rate < at_rate * (1 - _SAME_RATE):
            return NOT_KNOWN, f"; that was at {rate:g} requests/s, and the level is for {at_rate:g}"
        return KEPT, ""
    if interval[0] > allowed:
        if at_rate is not None and rate > at_rate * (1 + _SAME_RATE):
            return NOT_KNOWN, f"; that was at {rate:g} requests/s, and the level is for {at_rate:g}"
        return BROKEN, ""
    return NOT_KNOWN, "; the interval includes the limit: measure longer"


def _words(limit: str, most: float, beyond: int, total: int, interval: Interval | None, allowed: float) -> str:
    if interval is None:
        return "no request was measured"
    what = "failed" if limit == _ERRORS else f"took longer than {most:g} ms"
    sure = f"95 % interval {_percent(interval[0])} to {_percent(interval[1])}"
    return f"{beyond:,} of {total:,} requests {what} ({sure}); allowed is {_percent(allowed)}"


def _percent(share: float) -> str:
    return f"{share * 100:.3g} %"
