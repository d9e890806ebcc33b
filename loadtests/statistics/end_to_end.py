"""The `end_to_end` of latency.json: journeys from the request to the application, as figures.

A delivery that failed or never arrived counts in every figure, with at least the time for which it was waited: a robot
that loses its slow deliveries is not fast.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from loadtests.statistics.figures import plain_quantiles, rounded, rounded_interval
from loadtests.statistics.histogram import SHARES, Histogram
from loadtests.statistics.intervals import binomial_quantile, order_interval_ms

_BASE = "rest"

#: Nanoseconds by round; None for a round without any.
Journey = Sequence[int | None]


def ways(
    arrivals: Mapping[str, Journey], answers: Mapping[str, Journey], errors: Mapping[str, int], waited_ns: int
) -> list[dict[str, Any]]:
    """Return an entry of latency.json for each way by which deliveries were sent.

    Args:
        arrivals: nanoseconds from the request's start to the application, by round; None: never arrived.
        answers: nanoseconds to the response; None: this way has no response.
        errors: number of requests without a good response.
        waited_ns: how long the probe waited for each delivery.
    """
    return [
        _way(way, times, answers[way], errors[way], waited_ns)
        | {"over_rest": _over(times, arrivals[_BASE]) if way != _BASE and _BASE in arrivals else None}
        for way, times in arrivals.items()
    ]


def _way(way: str, times: Journey, answers: Journey, errors: int, waited_ns: int) -> dict[str, Any]:
    arrived = [time for time in times if time is not None]
    missing = len(times) - len(arrived)
    whole = Histogram.of([*arrived, *[max([waited_ns, *arrived])] * missing])
    figures = plain_quantiles(whole)
    return {
        "interface": way,
        "count": len(arrived),
        "lost": missing - errors,
        "errors": errors,
        "to_application_ms": figures,
        "at_least": [
            name
            for name, figure in figures.items()
            if missing and figure is not None and (name not in SHARES or SHARES[name] > len(arrived) / len(times))
        ],
        "ci95_ms": {name: rounded_interval(order_interval_ms(whole, SHARES[name])) for name in ("p50", "p99")},
        "answer_ms": plain_quantiles(Histogram.of(filter(None, answers))) if any(answers) else None,
    }


def _over(times: Journey, base: Journey) -> dict[str, Any]:
    """Return the median of the ratios of neighbours, and its interval by their order (the sign test's).

    A delivery that never arrived counts as longer than any other; pairs of two such deliveries are left out.
    """
    taken = ([math.inf if time is None else time for time in side] for side in (times, base))
    ratios = [one / other for one, other in zip(*taken, strict=False) if other and min(one, other) < math.inf]
    if not ratios:
        return {"ratio": None, "ci95": None}
    low, high = binomial_quantile(0.025, len(ratios), 0.5) - 1, binomial_quantile(0.975, len(ratios), 0.5)
    ranked = [math.nan, *sorted(ratios), math.nan]  # NaN where they are too few
    bounds = ranked[low + 1], ranked[high + 1]
    median = float(np.median(ratios))
    return {
        "ratio": rounded(median) if math.isfinite(median) else None,
        "ci95": rounded_interval(bounds) if all(map(math.isfinite, bounds)) else None,
    }


class Offset(NamedTuple):
    """Bounds on the robot's clock less ours, in s."""

    low_s: float
    high_s: float

    @property
    def middle_s(self) -> float:
        """Return the middle."""
        return (self.low_s + self.high_s) / 2

    @property
    def error_s(self) -> float:
        """Return by how much the middle may be wrong."""
        return (self.high_s - self.low_s) / 2


SHARED = Offset(0.0, 0.0)
