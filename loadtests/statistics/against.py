"""Is this robot slower than that one? The `against` of latency.json: changes, each with its interval and its verdict.

Both took turns in one run, so that what befell the machine met both. A robot counts as slower where the whole interval
of a ratio lies beyond the tolerance, and as not slower where its upper bound lies within it; in between it cannot be
told. To call a robot slower one ratio of several suffices, which makes a false alarm likelier with each: the lower
bounds are widened until all of them hold together (Bonferroni, on the logarithmic scale). To clear it every median has
to lie within the tolerance, which needs no such care (Berger, Technometrics 24, 1982: an intersection-union test).
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

from conformance.commandline.exit_codes import ExitCode
from loadtests.schedule.plan import SeriesName
from loadtests.statistics.figures import compared, named, pair_s, plain_quantiles, rounded_interval
from loadtests.statistics.intervals import figure_interval_ms
from loadtests.statistics.measured import Measured, Side

#: The median decides; a 99th percentile that is surely slower counts as well, one that nothing can be told of does not.
DECIDING = "p50"
JUDGED = (DECIDING, "p99")
_SHOWN = ("mean", "p50", "p90", "p99")
_CONFIDENCE = 0.95

SLOWER, NOT_SLOWER, UNCLEAR = "slower", "not slower", "unclear"
_CODES = {SLOWER: ExitCode.FAILED, NOT_SLOWER: ExitCode.PASSED, UNCLEAR: ExitCode.INCONCLUSIVE}


@dataclass(frozen=True)
class Judge:
    """What a change has to be to count.

    Attributes:
        tolerance: by which share this robot may be slower, 0.05 for 5 %.
        together: how many ratios are judged in the run.
    """

    tolerance: float
    together: int

    def verdict(self, ratio: float | None, interval: list[float] | None, noise: list[float] | None) -> str:
        """What the interval of a ratio says; `noise` is that of this robot's ratio to itself, where there is one."""
        if ratio is None or interval is None:
            return UNCLEAR
        beyond = 1 + self.tolerance
        if noise is not None and (noise[0] > beyond or noise[1] < 1 / beyond):
            return UNCLEAR  # a robot that differs from itself by more than is asked for: the run cannot tell
        if self._lowest(ratio, interval[0]) > beyond:
            return SLOWER
        return NOT_SLOWER if interval[1] <= beyond else UNCLEAR

    def _lowest(self, ratio: float, low: float) -> float:
        """The lower bound at the confidence at which the bounds of all ratios hold together."""
        alone, all_of_them = (NormalDist().inv_cdf(1 - (1 - _CONFIDENCE) / 2 / n) for n in (1, max(1, self.together)))
        return ratio * math.exp(math.log(max(low, 1e-9) / ratio) * all_of_them / alone)


def against(measured: Measured, noise_floor: list[dict[str, Any]], tolerance: float) -> dict[str, Any]:
    """The `against` of latency.json but for the other robot's addresses; `noise_floor` is that of the same run."""
    names = measured.plan.series_names()
    judge = Judge(tolerance, len(names) * len(JUDGED))
    noise = {
        (*(entry[key] for key in ("operation", "interface", "client")), entry["quantile"]): entry["ci95"]
        for entry in noise_floor
    }
    changes = []
    for name in names:
        # The other robot's first: the ratio is this robot's time over that one's.
        units = measured.paired(Side("against", name), Side("duel", name))
        length = pair_s(measured, "duel", name)
        for quantile in _SHOWN:
            change = compared(units, quantile, measured, "difference_ms", length)
            said = judge.verdict(change["ratio"], change["ci95"], noise.get((*name, quantile)))
            changes.append(named(name) | change | {"verdict": said if quantile in JUDGED else None})
    return {
        "tolerance": tolerance,
        "verdict": _overall(changes),
        "changes": changes,
        "series": [_series(measured, name) for name in names],
    }


def code_of(document: dict[str, Any] | None) -> int:
    """The exit code that follows from an `against`."""
    return ExitCode.PASSED if document is None else _CODES[document["verdict"]]


def _overall(changes: list[dict[str, Any]]) -> str:
    said = {change["verdict"] for change in changes}
    if SLOWER in said:
        return SLOWER
    deciding = [change["verdict"] for change in changes if change["quantile"] == DECIDING]
    return NOT_SLOWER if deciding and set(deciding) == {NOT_SLOWER} else UNCLEAR


def _series(measured: Measured, name: SeriesName) -> dict[str, Any]:
    """The other robot's figures, less than what `series` holds of this one."""
    whole = measured.total("against", name)
    units, seed = measured.units(name, "service", "against"), measured.plan.load.seed
    bounds = {
        quantile: rounded_interval(figure_interval_ms(units, quantile, seed).interval) for quantile in ("p50", "p99")
    }
    return named(name) | {
        "count": whole.service.total,
        "errors": whole.errors,
        "service_ms": plain_quantiles(measured.whole(name, "service", "against")),
        "response_ms": plain_quantiles(measured.whole(name, "response", "against")),
        "ci95_ms": bounds,
        "histogram": whole.service.encode(),
    }
