"""The part of an interval that one run cannot show: by how much runs differ.

Within a run the ratio of the interfaces hardly drifts, and resampling shows how exactly that run knows it. Another run
of the same robot finds another ratio all the same: what else the machine does adds to both interfaces' times, and that
changes over minutes. This is an uncertainty of type B (JCGM 100:2008, GUM, 4.3). Its size was found by measuring one
robot repeatedly (`benchmarks/repeatability.py`; the figures are in docs/load.md). Where a run has enough repeats, they
show it themselves, and nothing is added.
"""

import math
from typing import Any

Interval = tuple[float, float]

#: With fewer repeats the rounds of all are resampled, and the interval is widened by what the repeats differ.
LEAST_REPEATS = 4
#: Relative standard deviation of the ratio between runs: of a machine that had processors to spare, and of one that
#: had none when the run began.
IDLE_MACHINE, BUSY_MACHINE = 0.01, 0.02
_REACH = 1.959964  # standard deviations to either side hold 95 %


def between_runs(machine: dict[str, Any], cpus: int, repeats: int) -> float:
    """Return the standard deviation between runs, by the `machine` of the environment; 0 where repeats show it."""
    if repeats >= LEAST_REPEATS:
        return 0.0
    load = machine["load_average_before"]
    return BUSY_MACHINE if load is not None and load > cpus else IDLE_MACHINE


def widened_ratio(ratio: float, interval: Interval, deviation: float) -> Interval:
    """Widen a ratio's interval by the deviation between runs: variances add, on the logarithmic scale."""
    low, high = (math.log(bound / ratio) for bound in interval)
    reach = _REACH * deviation
    return ratio * math.exp(-math.hypot(min(low, 0.0), reach)), ratio * math.exp(math.hypot(max(high, 0.0), reach))


def widened_difference(difference: float, interval: Interval, deviation_ms: float) -> Interval:
    """Widen the interval of a difference by a standard deviation between runs, in milliseconds."""
    low, high = (bound - difference for bound in interval)
    reach = _REACH * deviation_ms
    return difference - math.hypot(min(low, 0.0), reach), difference + math.hypot(max(high, 0.0), reach)
