"""The `end_to_end` of latency.json: journeys from the request to the application, as figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from loadtests.statistics.figures import plain_quantiles, rounded, rounded_interval
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.intervals import at_most, order_interval_ms
from loadtests.statistics.rounds import SHARES

_TAIL = 0.025
_BASE = "rest"

#: Nanoseconds by round; None for a round without any.
Journey = Sequence[int | None]


def ways(
    arrivals: Mapping[str, Journey], answers: Mapping[str, Journey], errors: Mapping[str, int]
) -> list[dict[str, Any]]:
    """An entry for each way.

    Args:
        arrivals: nanoseconds from the request's start to the application, by round; None where it never came.
        answers: likewise to the request's answer; None where the way has none.
        errors: requests that brought no good answer.
    """
    return [
        {
            "interface": way,
            "count": sum(time is not None for time in times),
            "lost": sum(time is None for time in times) - errors[way],
            "errors": errors[way],
            "to_application_ms": plain_quantiles(_histogram(times)),
            "ci95_ms": {
                name: rounded_interval(order_interval_ms(_histogram(times), SHARES[name])) for name in ("p50", "p99")
            },
            "answer_ms": plain_quantiles(_histogram(answers[way])) if any(answers[way]) else None,
            "over_rest": _over(times, arrivals[_BASE]) if way != _BASE and _BASE in arrivals else None,
        }
        for way, times in arrivals.items()
    ]


def _histogram(times: Journey) -> Histogram:
    made = Histogram()
    made.record(np.array([time for time in times if time is not None], dtype=np.int64))
    return made


def _over(times: Journey, base: Journey) -> dict[str, Any]:
    """The median of the ratios of neighbours, and its interval from their order (the sign test's)."""
    pairs = zip(times, base, strict=False)
    ratios = sorted(one / other for one, other in pairs if one is not None and other)
    rank = max((rank for rank in range(len(ratios) // 2) if at_most(rank, len(ratios), 0.5) <= _TAIL), default=None)
    return {
        "ratio": rounded(float(np.median(ratios))) if ratios else None,
        "ci95": None if rank is None else rounded_interval((ratios[rank], ratios[-1 - rank])),
    }
