"""Statistics on made-up data, where the truth is known; service levels."""

import math

import numpy as np
import pytest

from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.plan import Load, Plan
from loadtests.statistics.comparisons import judge as judge_ratio
from loadtests.statistics.figures import quantiles, series
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.intervals import (
    Replicates,
    binomial_quantile,
    compare,
    figure_interval_ms,
    order_interval_ms,
    pooled_interval,
    samples_for_interval,
    samples_for_point,
)
from loadtests.statistics.measured import Measured
from loadtests.statistics.over_time import theil_sen, time_series
from loadtests.statistics.recorder import Recorder
from loadtests.statistics.rounds import Sample, Unit, in_rounds
from loadtests.statistics.service_levels import BROKEN, KEPT, NOT_KNOWN, _outcome, share_interval


def block(values_ms):
    return Histogram.of(int(value * 1e6) for value in values_ms)


def test_how_many_samples_a_quantile_needs():
    assert [samples_for_point(q) for q in (0.5, 0.9, 0.99, 0.999)] == [4, 20, 1000, 10_000]
    assert [samples_for_interval(q) for q in (0.5, 0.9, 0.95, 0.99, 0.999)] == [6, 36, 72, 368, 3688]


def test_too_few_samples_say_so_instead_of_a_number():
    figures, reasons = quantiles(block([1.0] * 150))
    assert figures["p50"] == pytest.approx(1.0, rel=2e-3)
    assert figures["p99"] is None
    assert reasons["p99"] == "150 samples; p99 needs 1000"
    assert quantiles(Histogram())[0]["mean"] is None


def test_intervals_cover_the_truth_as_often_as_they_promise():
    rng = np.random.default_rng(3)
    medians = ratios = 0
    trials = 40
    for trial in range(trials):
        drift = rng.normal(0, 0.05, size=(30, 1))
        rest = np.exp(rng.normal(0, 0.2, size=(30, 20)) + drift)
        soap = 1.5 * np.exp(rng.normal(0, 0.2, size=(30, 20)) + drift)
        low, high = figure_interval_ms([Unit(0, (block(row),)) for row in rest], "p50", trial).interval
        medians += low <= 1.0 <= high
        found = compare([Unit(0, (block(a), block(b))) for a, b in zip(rest, soap, strict=True)], "p50", trial)
        ratios += found.ci95[0] <= 1.5 <= found.ci95[1]
        assert found.ci95[0] <= found.ratio <= found.ci95[1]
    assert medians >= 0.85 * trials
    assert ratios >= 0.85 * trials


def test_a_drift_that_meets_both_sides_does_not_widen_the_ratio():
    rng = np.random.default_rng(4)
    drift = np.linspace(1, 3, 40)[:, None]
    rest = drift * np.exp(rng.normal(0, 0.02, size=(40, 20)))
    soap = 2 * drift * np.exp(rng.normal(0, 0.02, size=(40, 20)))
    low, high = compare([Unit(0, (block(a), block(b))) for a, b in zip(rest, soap, strict=True)], "mean", 1).ci95
    assert 1.97 < low < 2.0 < high < 2.03


def test_comparisons_that_are_pooled_are_resampled_independently_of_one_another():
    rng = np.random.default_rng(6)
    units = [Unit(0, tuple(block(np.exp(rng.normal(0, 0.2, 20))) for _ in range(2))) for _ in range(60)]
    alone, same, other = (compare(units, "p50", 1, stream=stream) for stream in (0, 0, 1))
    widths = [
        np.log(high / low)
        for low, high in (alone.ci95, pooled_interval([alone, same]), pooled_interval([alone, other]))
    ]
    assert widths[1] == pytest.approx(widths[0], rel=0.06)  # the same resamples twice say nothing new
    assert widths[2] == pytest.approx(widths[0] / np.sqrt(2), rel=0.08)


def test_few_blocks_give_a_ratio_without_an_interval():
    found = compare([Unit(0, (block([1.0]), block([2.0])))] * 3, "p50", 1)
    assert found.ratio == pytest.approx(2.0, rel=2e-3)
    assert found.ci95 is None
    assert compare([], "p50", 1) is None


def test_the_order_of_independent_samples_gives_an_interval_too():
    rng = np.random.default_rng(5)
    covered = sum(
        low <= 1.0 <= high
        for low, high in (order_interval_ms(block(np.exp(rng.normal(0, 0.3, 40))), 0.5) for _ in range(200))
    )
    assert 184 <= covered <= 200
    assert order_interval_ms(block([1.0] * 367), 0.99) is None
    assert order_interval_ms(block([1.0] * 368), 0.99) is not None


LOAD = Load(rate=400.0, users=None, duration_s=20.0, warmup_s=0.0, arrivals="constant", seed=1)
STALL = Plan(("pose",), ("rest", "soap"), ("wire", "zeep"), LOAD, timeout_s=10.0, workers=1, connections=300)


def simulated(plan, stall_from, stall_s, service_ms=1.0, *, open_model=True):
    """A robot that answers in `service_ms`, except that it stands still once; the generator is perfect."""
    recorder, schedule = Recorder(plan.series_of()), Schedule(plan, 0, 1)
    free = 0
    for segment in range(schedule.count()):
        for due, operation, _ in schedule.arrivals(segment):
            start = due if open_model else max(due, free)
            done = start + int(service_ms * 1e6)
            if stall_from <= start / 1e9 < stall_from + stall_s:
                done += int((stall_from + stall_s) * 1e9) - start
            free = done
            recorder.record(segment, operation, due if open_model else start, start, start, done, done, -1)
    recorder.flush()
    return Measured([plan], recorder)


@pytest.mark.parametrize("stall_from", [2.0, 7.3, 11.05, 16.6])
def test_a_stall_of_two_seconds_in_twenty_shows_in_the_p99(stall_from):
    measured = simulated(STALL, stall_from, 2.0)
    assert max(entry.response_ms["p99"] for entry in series(measured, {}) if entry.response_ms["p99"]) > 1200
    points = [point for entry in time_series(measured)["series"] for point in entry["points"]]
    assert max(point["max_ms"] for point in points) > 1800


def test_a_generator_that_waits_for_answers_would_not_have_seen_it():
    measured = simulated(STALL, 7.3, 2.0, open_model=False)
    assert max(entry.response_ms["p99"] or 0 for entry in series(measured, {})) < 10


def test_an_interval_without_end_has_bounds_that_can_be_reckoned_with():
    rounds = in_rounds(Sample(np.array([0]), np.ones((1, 2, 1)), np.array([0, 0])), "p50")
    wild = np.geomspace(1e-200, 1e200, 2000)
    low, high = Replicates(np.ones(1), wild[None, :], rounds, 5, 3.0).interval(wild, 1.0)
    assert 0 < low < 1 < high < math.inf
    assert judge_ratio(1.0, (low, high), (low, high)).verdict == "none"
    assert judge_ratio(0.5, (low, high), (0.9, 1.1)).verdict == "none"


@pytest.mark.parametrize("chance", [0.01, 0.5, 0.9, 0.999])
@pytest.mark.parametrize("trials", [1, 2, 7, 60, 900])
def test_a_binomial_quantile_is_the_first_number_whose_cumulative_probability_reaches_the_share(trials, chance):
    single = [math.comb(trials, k) * chance**k * (1 - chance) ** (trials - k) for k in range(trials + 1)]
    for share in (0.025, 0.4, 0.975):
        found = binomial_quantile(share, trials, chance)
        assert math.fsum(single[:found]) < share <= math.fsum(single[: found + 1])


@pytest.mark.parametrize("cells", [3, 10_000])
def test_a_slope_and_its_interval_are_those_of_scipy(cells):
    from scipy import stats  # noqa: PLC0415 - it takes half a second, in each process that shares the tests

    random = np.random.default_rng(1)
    for slope in (-1.0, 0.0, 0.3):
        times = np.cumsum(random.uniform(0.1, 1.0, 20))
        values = np.round((slope * times + random.standard_normal(20)) * cells) / cells  # a few cells: many are equal
        expected = stats.theilslopes(values, times, 0.99)
        assert theil_sen(times, values) == pytest.approx((expected.slope, expected.low_slope, expected.high_slope))


def test_without_bursts_the_interval_is_that_of_clopper_and_pearson():
    low, high = share_interval([(1, 100), (2, 100), (0, 100)])
    assert (low, high) == (
        pytest.approx(0.0020670072350923),
        pytest.approx(0.0289445112556927),
    )  # scipy.stats.binomtest
    assert share_interval([(0, 0)]) is None
    assert share_interval([(0, 3700)])[1] < 0.001 < share_interval([(0, 3600)])[1]
    assert share_interval([(50, 50)])[0] == pytest.approx(0.025 ** (1 / 50))


def test_failures_in_bursts_say_less():
    spread = [(1, 20)] * 40
    bursts = [(20 if place in {3, 4} else 0, 20) for place in range(40)]
    wide, narrow = share_interval(bursts), share_interval(spread)
    assert wide[0] < narrow[0] < narrow[1] < wide[1]
    assert wide[1] - wide[0] > 2 * (narrow[1] - narrow[0])


def test_the_interval_holds_the_share_as_often_as_it_says_even_if_failures_come_in_bursts():
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(200):
        bad = np.repeat(rng.random(60) < 0.1, 2)  # bursts of two blocks, in which half of the requests fail
        low, high = share_interval([(rng.binomial(20, 0.5 if one else 0.0), 20) for one in bad])
        held += low <= 0.05 <= high
    assert held >= 184, "95 % of 200, less two standard deviations"


@pytest.mark.parametrize(
    ("interval", "rate", "at_rate", "outcome", "why"),
    [
        ((0.0, 0.01), 100.0, None, KEPT, ""),
        ((0.0, 0.01), 100.0, 101.0, KEPT, ""),
        ((0.0, 0.01), 50.0, 100.0, NOT_KNOWN, "at 50 requests/s, and the level is for 100"),
        ((0.0, 0.01), 200.0, 100.0, KEPT, ""),
        ((0.011, 0.02), 200.0, 100.0, NOT_KNOWN, "at 200 requests/s, and the level is for 100"),
        ((0.011, 0.02), 50.0, 100.0, BROKEN, ""),
        ((0.001, 0.02), 100.0, 100.0, NOT_KNOWN, "measure longer"),
        (None, 100.0, None, NOT_KNOWN, ""),
    ],
)
def test_a_level_is_known_only_at_its_own_rate(interval, rate, at_rate, outcome, why):
    found = _outcome(interval, 0.01, rate, at_rate)
    assert found[0] == outcome
    assert why in found[1]
