"""From messages to figures: the streams of latency.json."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from loadtests.statistics.figures import rounded
from loadtests.statistics.histogram import SHARES
from loadtests.statistics.intervals import samples_for_point
from loadtests.statistics.recorder import Offset

_GAP = 2.0
_ENOUGH = 3


def stream_figures(
    moments_ns: Sequence[int], ages_ms: Sequence[float], listened_s: float, offset: Offset | None
) -> dict[str, Any]:
    """Return figures on the messages of a stream; None where there are too few.

    A gap is an interval of more than twice the median; the jitter is the intervals' standard deviation.

    Args:
        moments_ns: when each came.
        ages_ms: our clock less the stamp, of those with a stamp.
        listened_s: for how long they were waited for.
        offset: of the robot's clock; None where it is not known, so that the ages are not known either.
    """
    intervals = np.diff(np.array(moments_ns, dtype=np.float64)) / 1e6
    found: dict[str, Any] = {
        "messages": len(moments_ns),
        "listened_s": rounded(listened_s),
        "rate": None,
        "interval_ms": None,
        "jitter_ms": None,
        "gaps": None,
        "stamped": len(ages_ms),
        "clock_offset_ms": None if offset is None else rounded(offset.middle_s * 1e3),
        "age_ms": None if offset is None else _spread([age + offset.middle_s * 1e3 for age in ages_ms]),
        "age_error_ms": None if offset is None else rounded(offset.error_s * 1e3),
    }
    if len(intervals) >= _ENOUGH:
        limit = _GAP * float(np.median(intervals))
        found |= {
            "rate": rounded(1e3 * len(intervals) / float(intervals.sum())) if intervals.sum() else None,
            "interval_ms": _spread(intervals.tolist()),
            "jitter_ms": rounded(float(intervals.std(ddof=1))),
            "gaps": {"longer_than_ms": rounded(limit), "count": int((intervals > limit).sum())},
        }
    return found


def _spread(values: Sequence[float]) -> dict[str, float | None] | None:
    """Return extremes and quantiles in ms; None where there are too few values."""
    if len(values) < _ENOUGH:
        return None
    found = {"min": min(values), "max": max(values)}
    for name in ("p50", "p90", "p99"):
        if len(values) >= samples_for_point(SHARES[name]):
            found[name] = float(np.quantile(np.array(values), SHARES[name]))
    return {name: rounded(found.get(name)) for name in ("min", "p50", "p90", "p99", "max")}
