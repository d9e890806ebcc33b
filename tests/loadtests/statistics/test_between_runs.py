"""What runs differ by beyond what one of them can see is in the interval of the ratio."""

import math

import numpy as np
import pytest

from loadtests.statistics.histogram import Histogram
from loadtests.statistics.intervals import compare
from loadtests.statistics.rounds import (
    BUSY_MACHINE,
    IDLE_MACHINE,
    Unit,
    between_runs,
    widened_difference,
    widened_ratio,
)


def test_variances_add_on_the_logarithmic_scale():
    low, high = widened_ratio(1.4, (1.4 / 1.02, 1.4 * 1.03), 0.01)
    assert math.log(1.4 / low) == pytest.approx(math.hypot(math.log(1.02), 1.96 * 0.01), rel=1e-3)
    assert math.log(high / 1.4) == pytest.approx(math.hypot(math.log(1.03), 1.96 * 0.01), rel=1e-3)
    assert widened_ratio(1.4, (1.3, 1.5), 0.0) == pytest.approx((1.3, 1.5))
    assert widened_difference(0.1, (0.07, 0.14), 0.0) == pytest.approx((0.07, 0.14))
    assert widened_difference(-0.1, (-0.1, -0.1), 0.01) == pytest.approx((-0.1196, -0.0804), abs=1e-4)


def test_an_estimate_outside_of_its_own_interval_makes_it_no_narrower():
    low, high = widened_ratio(1.4, (1.41, 1.45), 0.01)
    assert low == pytest.approx(1.4 * math.exp(-0.0196), rel=1e-4)
    assert high > 1.45


@pytest.mark.parametrize(
    ("load", "repeats", "deviation"),
    [(0.5, 1, IDLE_MACHINE), (2.0, 3, IDLE_MACHINE), (2.1, 1, BUSY_MACHINE), (None, 1, IDLE_MACHINE), (9.0, 4, 0.0)],
)
def test_a_busy_machine_makes_runs_differ_more_and_repeats_show_it(load, repeats, deviation):
    assert between_runs({"load_average_before": load}, 2, repeats) == deviation


def test_intervals_hold_for_another_run():
    """Runs whose true ratios scatter by 2 %: nine of ten intervals and more hold the ratio about which they do."""
    rng = np.random.default_rng(7)
    held = {0.0: 0, 0.02: 0}
    for run in range(40):
        ratio = 1.4 * math.exp(rng.normal(0, 0.02))
        units = [
            Unit(0, (block(np.exp(rng.normal(0, 0.05, 30))), block(ratio * np.exp(rng.normal(0, 0.05, 30)))))
            for _ in range(20)
        ]
        for deviation in held:
            low, high = compare(units, "p50", run, deviation=deviation).ci95
            held[deviation] += low <= 1.4 <= high
    assert held[0.02] >= 36
    assert held[0.0] <= 24


def block(values_ms):
    return Histogram.of(int(value * 1e6) for value in values_ms)
