"""Is this robot slower than that one? The `against` of latency.json: changes, each with its interval and its verdict.

Both robots take turns in one run, so that whatever disturbs the machine disturbs both. A robot counts as slower where
the whole interval of a ratio lies beyond the tolerance, and as not slower where its upper bound lies within it; in
between the run is unclear. One ratio of several suffices to call a robot slower, which makes a false positive likelier
with each: the lower bounds are widened until all of them hold together (Bonferroni, on the logarithmic scale). The A/A
control cannot see how two processes of one program differ, such as in the processor that each waits for: so the
intervals hold the variation between runs, and a robot is slower only if all parts of the run show it. To clear
a robot every median has to lie within the tolerance, which needs no such correction (an intersection-union test:
Berger, Technometrics 24, 1982). A run that goes on while it is unclear is judged several times, and each time could go
wrong: both bounds are widened by the number of times (Armitage, McPherson and Rowe 1969; Bonferroni).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import msgspec

from conformance.commandline.exit_codes import ExitCode
from loadtests.schedule.plan import SeriesName
from loadtests.statistics.comparisons import CLAIMS, AaControl, Judged, compare_sides
from loadtests.statistics.figures import name_fields, plain_quantiles, rounded_interval
from loadtests.statistics.intervals import figure_interval_ms
from loadtests.statistics.measured import Measured, Side

#: DECIDING decides. A p99 that is certainly slower counts too; one without a clear verdict does not.
DECIDING = "p50"
JUDGED = (DECIDING, "p99")
_SHOWN = ("mean", "p50", "p90", "p99")
_CONFIDENCE = 0.95
SLOWER, NOT_SLOWER, UNCLEAR = "slower", "not slower", "unclear"
EXIT_CODES = {SLOWER: ExitCode.FAILED, NOT_SLOWER: ExitCode.PASSED, UNCLEAR: ExitCode.INCONCLUSIVE}


class Change(Judged, kw_only=True):
    """The ratio of this robot's quantile to the other robot's, with the verdict if the quantile is judged."""

    interface: str
    verdict: str | None = None


class Against(msgspec.Struct, kw_only=True):
    """The `against` of latency.json.

    Attributes:
        robot: the other robot's addresses.
        looks: how often at most the run was judged, by which the verdicts' intervals are widened.
        series: the other robot's figures.
    """

    robot: dict[str, str | None]
    tolerance: float
    looks: int = 1
    verdict: str
    changes: list[Change]
    series: list[dict[str, Any]]


@dataclass(frozen=True)
class Judge:
    """The tolerance and controls by which a change counts.

    Attributes:
        tolerance: by which share this robot may be slower, 0.05 for 5 %.
        together: how many ratios are judged in the run.
        looks: how often at most the run is judged.
    """

    tolerance: float
    together: int
    looks: int = 1

    def verdict(self, change: Change) -> str:
        """Return the verdict on a change that was judged by the A/A control, where there was one."""
        ratio, interval, control = change.ratio, change.ci95, change.noise_ci95
        if ratio is None or interval is None:
            return UNCLEAR
        beyond = 1 + self.tolerance
        if control is not None and (control[0] > beyond or control[1] < 1 / beyond):
            return UNCLEAR  # this robot differs from itself by more than the tolerance
        low, high = interval
        if _widen(ratio, low, self.together * self.looks) > beyond:
            return SLOWER if change.judgement in CLAIMS else UNCLEAR
        return NOT_SLOWER if _widen(ratio, high, self.looks) <= beyond else UNCLEAR


def _widen(ratio: float, bound: float, together: int) -> float:
    """Return a bound of a ratio's interval at the confidence at which so many such bounds hold together."""
    alone, all_of_them = (NormalDist().inv_cdf(1 - (1 - _CONFIDENCE) / 2 / n) for n in (1, max(1, together)))
    return ratio * math.exp(math.log(max(bound, 1e-9) / ratio) * all_of_them / alone)


def against(
    measured: Measured,
    controls: Sequence[AaControl],
    tolerance: float,
    looks: int,
    robot: dict[str, str | None],
    deviation: float,
) -> Against:
    """Compare this robot with the other one.

    Args:
        measured: the records of both.
        controls: this robot's A/A controls in the same run.
        tolerance: the share by which this robot may be slower.
        looks: how often at most the run is judged.
        robot: the other robot's addresses.
        deviation: relative standard deviation of the ratio between runs.
    """
    names = measured.plan.series_names()
    judge = Judge(tolerance, len(names) * len(JUDGED), looks)
    known = {(entry.operation, entry.interface, entry.client, entry.quantile): entry.ci95 for entry in controls}
    changes = []
    for name in names:
        for quantile in _SHOWN:
            # The other robot comes first, so that the ratio is this robot's time over the other's.
            fields = compare_sides(measured, Side("against", name), Side("duel", name), quantile, deviation)
            change = Change(**name_fields(name), **fields)
            # A short run has no A/A interval, and may show a large difference all the same.
            change.judge(known.get((*name, quantile)), deviation, controlled=False)
            if quantile in JUDGED:
                change.verdict = judge.verdict(change)
            changes.append(change)
    series = [_series(measured, name) for name in names]
    overall = _overall(changes)
    return Against(robot=robot, tolerance=tolerance, looks=looks, verdict=overall, changes=changes, series=series)


def _overall(changes: Sequence[Change]) -> str:
    if any(change.verdict == SLOWER for change in changes):
        return SLOWER
    deciding = {change.verdict for change in changes if change.quantile == DECIDING}
    return NOT_SLOWER if deciding == {NOT_SLOWER} else UNCLEAR


def _series(measured: Measured, name: SeriesName) -> dict[str, Any]:
    """Return the other robot's figures, which are fewer than this robot's in `series`."""
    whole = measured.total(name, "against")
    units, seed = measured.units(name, "service", "against"), measured.plan.load.seed
    return name_fields(name) | {
        "count": whole.service.total,
        "errors": whole.errors,
        "service_ms": plain_quantiles(measured.whole(name, "service", "against")),
        "response_ms": plain_quantiles(measured.whole(name, "response", "against")),
        "ci95_ms": {
            quantile: rounded_interval(figure_interval_ms(units, quantile, seed).interval) for quantile in JUDGED
        },
        "histogram": whole.service.encode(),
    }
