"""What runs differ by beyond what one of them can see is in the interval of the ratio."""

import math
import os

import numpy as np
import pytest

from loadtests.statistics.comparisons import CLAIMS, judge
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
    [(0.0, 1, IDLE_MACHINE), (1.0, 3, IDLE_MACHINE), (1.1, 1, BUSY_MACHINE), (None, 1, IDLE_MACHINE), (9.0, 4, 0.0)],
)
def test_a_busy_machine_makes_runs_differ_more_and_repeats_show_it(load, repeats, deviation):
    averages = None if load is None else (load * (os.cpu_count() or 1), 0.0, 0.0)
    assert between_runs(averages, repeats) == deviation


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


def test_two_copies_whose_slow_phases_are_their_own_are_not_told_apart():
    """Two equal robots in blocks of 0.1 s, four times as slow for 45 % of the time, each in phases of its own."""
    claims, without_parts, trials = 0, 0, 60
    for trial in range(trials):
        rng = np.random.default_rng(trial)
        slow = [phases(rng, 0.5), phases(rng, 0.5)]
        units = []
        for pair in range(80):
            order = rng.permutation(2)
            times = [np.exp(rng.normal(0, 0.3, 5)) * slow[robot][2 * pair + order[robot]] for robot in (0, 1)]
            units.append(Unit(0, (block(times[0]), block(times[1]))))
        found = compare(units, "p50", trial, deviation=IDLE_MACHINE)
        claims += judge(found.ratio, found.ci95, (1.0, 1.0), found.parts).verdict in CLAIMS
        without_parts += judge(found.ratio, found.ci95, (1.0, 1.0)).verdict in CLAIMS
    assert claims <= 0.03 * trials
    assert without_parts > 0.05 * trials, "the intervals alone are too narrow here"


def phases(rng, mean_s):
    """Return by which factor each of 160 blocks is slower."""
    factors = []
    while len(factors) < 160:
        for factor, share in ((4.0, 0.9), (1.0, 1.1)):
            factors += [factor] * (1 + int(rng.exponential(10 * mean_s * share)))
    start = rng.integers(len(factors))
    return np.roll(factors, start)


def block(values_ms):
    return Histogram.of(int(value * 1e6) for value in values_ms)
