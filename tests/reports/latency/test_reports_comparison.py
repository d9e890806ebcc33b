"""Did it get slower?"""

import copy
import math

import numpy as np
import pytest
from latencies import scaled

from reports.errors import ResultsIncompatibleError
from reports.latency.comparison import compare, judge, ratio_interval, widened
from reports.latency.comparison_page import comparison_html, comparison_markdown, table, verdict

NAMES = ("old.json", "new.json")


def compared(old, new, threshold=0.05):
    return compare(old, new, NAMES, threshold)


def test_same_result_is_no_change(latency):
    found = compared(latency, latency)
    assert not found.slower
    assert {change.verdict for change in found.changes} <= {"same", "unclear", "no figure"}
    assert all(change.ratio == 1.0 for change in found.changes)
    assert verdict(found).words.startswith("No change")


def test_slower_is_found_where_it_is(latency):
    found = compared(latency, scaled(latency, 1.2, "soap"))
    assert found.slower
    slower = found.with_verdict("slower")
    assert {change.interface for change in slower} == {"soap"}
    assert slower[0].ratio == pytest.approx(1.2)
    assert slower[0].interval[0] < 1.2 < slower[0].interval[1]
    assert verdict(found).words == "It got slower"


def test_the_headline_is_what_is_known_best_and_not_what_changed_most(latency):
    new = scaled(latency, 1.2, "soap")
    for series in new["series"]:  # a tail that doubled, known to a quarter
        for time, bounds in (("service_ms", "ci95_ms"), ("response_ms", "response_ci95_ms")):
            series[time]["p99"] *= 2
            series[bounds]["p99"] = [series[time]["p99"] / 1.25, series[time]["p99"] * 1.25]
    found = compared(latency, new)
    assert max(change.ratio for change in found.with_verdict("slower")) > 1.9
    assert "at 50 % went from" in verdict(found).sentence
    unsure = compared(latency, scaled(latency, 1.01), 0.001)
    assert verdict(unsure).words == "No change can be shown"
    widths = {change: math.log(change.interval[1] / change.interval[0]) for change in unsure.with_verdict("unclear")}
    assert next(iter(widths)).quantile == "p50"


def test_where_a_machine_was_busy_one_run_with_both_is_the_way(latency):
    assert "--against" not in verdict(compared(latency, latency)).sentence
    latency["environment"]["machine"] = {"load_average_before": latency["environment"]["cpus"] * 5.0}
    for new in (scaled(latency, 1.2, "soap"), scaled(latency, 1.01)):
        told = verdict(compared(latency, new, 0.001)).sentence
        assert "in one run with roaas load --against" in told
    assert not compared(latency, scaled(latency, 1.5)).slower, "two runs on a busy machine differ by as much"
    doubled = compared(latency, scaled(latency, 3.0))
    assert {change.quantile for change in doubled.with_verdict("slower")} == {"p50"}, "no p99 is known there"


def test_faster_is_no_failure(latency):
    found = compared(latency, scaled(latency, 0.7, "soap"))
    assert not found.slower
    assert found.with_verdict("faster")
    assert verdict(found).words == "It got faster"


@pytest.mark.parametrize(("threshold", "slower"), [(0.05, True), (0.15, True), (0.25, False)])
def test_threshold(latency, threshold, slower):
    assert compared(latency, scaled(latency, 1.2, "soap"), threshold).slower is slower


def test_noise_floor_raises_the_threshold(latency):
    noisy = scaled(latency, 1.2, "soap")
    for noise in noisy["noise_floor"]:
        noise["ci95"] = [0.7, 1.3]
    found = compared(latency, noisy)
    assert {c.threshold for c in found.changes if c.quantile == "p50" and c.client == "wire"} == {1 / 0.7 - 1}
    assert not [change for change in found.with_verdict("slower") if change.client == "wire"]


@pytest.mark.parametrize(
    ("interval", "expected"),
    [
        ((1.06, 1.2), "slower"),
        ((1.04, 1.2), "unclear"),
        ((0.99, 1.01), "same"),
        ((0.8, 0.94), "faster"),
        ((0.9, 1.1), "unclear"),
    ],
)
def test_judgement(interval, expected):
    assert judge(interval, 0.05, 0.05) == expected


def test_noise_makes_nothing_the_same():
    assert judge((1.02, 1.13), 0.2, 0.05) == "unclear"
    assert judge((1.06, 1.13), 0.2, 0.05) == "unclear"


def test_ratio_interval_is_that_of_independent_estimates():
    old, new, arm_old, arm_new = 1.0, 1.5, 0.03, 0.04
    bounds = ((value * math.exp(-arm), value * math.exp(arm)) for value, arm in ((old, arm_old), (new, arm_new)))
    low, high = ratio_interval(old, next(bounds), new, next(bounds))
    assert (low, high) == (pytest.approx(1.5 * math.exp(-0.05)), pytest.approx(1.5 * math.exp(0.05)))


def test_ratio_interval_covers_the_true_ratio():
    generator = np.random.default_rng(3)

    def estimate(scale):
        medians = np.median(generator.lognormal(math.log(scale), 0.3, (300, 200)), axis=1)
        return float(medians[0]), [
            float(q) for q in medians[0] * np.exp(np.array([-1.96, 1.96]) * np.std(np.log(medians)))
        ]

    covered = 0
    for _ in range(100):
        (old, old_bounds), (new, new_bounds) = estimate(1.0), estimate(1.3)
        low, high = ratio_interval(old, old_bounds, new, new_bounds)
        covered += low <= 1.3 <= high
    assert 88 <= covered <= 100


@pytest.mark.parametrize(
    ("old", "old_bounds", "new", "new_bounds"),
    [(None, [1, 2], 1.0, [1, 2]), (1.0, None, 1.0, [1, 2]), (0.0, [0, 0], 1.0, [1, 2]), (1.0, [0, 2], 1.0, [1, 2])],
)
def test_no_interval_without_four_figures(old, old_bounds, new, new_bounds):
    assert ratio_interval(old, old_bounds, new, new_bounds) is None


def test_estimate_outside_of_its_interval():
    low, high = ratio_interval(1.0, [1.1, 1.2], 1.0, [0.8, 0.9])
    assert low <= 1.0 <= high


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("model", "closed", "closed"),
        ("rate", 500.0, "500 requests/s|at 500"),
        ("users", 8, "8"),
        ("rate", None, "rate|at"),
    ],
)
def test_other_load_cannot_be_compared(latency, key, value, told):
    other = copy.deepcopy(latency)
    other["plan"][key] = value
    with pytest.raises(ResultsIncompatibleError, match=told):
        compared(latency, other)


def test_a_closed_model_under_another_cap_cannot_be_compared(latency):
    old, new = copy.deepcopy(latency), copy.deepcopy(latency)
    for result, cap in ((old, 500.0), (new, None)):
        result["plan"] |= {"model": "closed", "rate": None, "users": 4, "limits": {"max_rate": cap}}
    with pytest.raises(ResultsIncompatibleError, match=r"a cap of 500 requests/s and new\.json under no cap"):
        compared(old, new)
    assert compared(old, copy.deepcopy(old)).changes


def test_nothing_in_common(latency):
    rest, soap = copy.deepcopy(latency), copy.deepcopy(latency)
    rest["series"] = [s for s in rest["series"] if s["interface"] == "rest"]
    soap["series"] = [s for s in soap["series"] if s["interface"] == "soap"]
    with pytest.raises(ResultsIncompatibleError, match="no series in common"):
        compared(rest, soap)


def test_what_else_changed_is_told(latency):
    other = copy.deepcopy(latency)
    other["environment"]["cpu"] = "Another CPU"
    other["series"][0]["errors"] = 500
    other["series"].pop()
    other["knee_search"][0].update(rate=2000, interval=[1900, 2100])
    told = " ".join(compared(latency, other).remarks)
    for wanted in ("cpu was Example CPU", "More requests failed", "Only in the old result", "and is now at 2,000"):
        assert wanted in told


def test_invalid_result_gives_no_answer(latency):
    other = copy.deepcopy(latency)
    other.update(valid=False, invalid_because=["generator CPU at 97 %"])
    found = compared(latency, other)
    assert not found.valid
    assert {change.verdict for change in found.changes} == {"not compared"}
    assert "generator CPU at 97 %" in verdict(found).sentence


def test_pages_draw_both(latency):
    latency["series"] = latency["series"][:2]
    found = compared(latency, scaled(latency, 1.2, "soap"))
    source = comparison_html(found, NAMES)
    assert len(source) < 1_500_000
    for said in ('id="change-figure"', 'id="ratios-figure"', "It got slower"):
        assert said in source
    assert "It got slower" in comparison_markdown(found, NAMES)


def test_table_is_aligned(latency):
    lines = table(compared(latency, latency)).split("\n")
    assert len(lines) == 33
    assert len({line.index("%") for line in lines[1:]}) == 1


def test_intervals_hold_together():
    assert widened(1.2, (1.1, 1.3), 1) == pytest.approx((1.1, 1.3))
    low, high = widened(1.2, (1.1, 1.3), 20)
    # 1 - 0.05 / 20 on both sides: 3.02 standard errors for 1.96.
    assert math.log(1.2 / low) == pytest.approx(math.log(1.2 / 1.1) * 3.0233 / 1.9600, rel=1e-3)
    assert math.log(high / 1.2) == pytest.approx(math.log(1.3 / 1.2) * 3.0233 / 1.9600, rel=1e-3)


def test_no_false_alarm_among_many_quantiles(latency):
    # Each quantile of an unchanged robot, drawn anew within its own interval, over 60 pairs of runs.
    generator = np.random.default_rng(11)

    def drawn():
        changed = copy.deepcopy(latency)
        for series in changed["series"]:
            for values, bounds in (("service_ms", "ci95_ms"), ("response_ms", "response_ci95_ms")):
                for name, interval in series[bounds].items():
                    if interval is None:
                        continue
                    error = generator.normal(0, math.log(interval[1] / interval[0]) / 3.92)
                    series[values][name] *= math.exp(error)
                    series[bounds][name] = [bound * math.exp(error) for bound in interval]
        return changed

    assert sum(compared(drawn(), drawn(), 0.0).slower for _ in range(60)) <= 6


def test_difference_within_the_generators_lag_is_none_of_the_robots(latency):
    changed = scaled(latency, 1.5, "soap")
    assert {c.time for c in compared(latency, changed).with_verdict("slower")} == {"service", "response"}
    changed["generator"]["lag_ms"].update(p50=5.0, p99=500.0)
    assert {c.time for c in compared(latency, changed).with_verdict("slower")} == {"service"}


def test_noise_of_a_quantile_that_was_not_measured(latency):
    noisy = copy.deepcopy(latency)
    noisy["noise_floor"] = [n for n in noisy["noise_floor"] if n["quantile"] == "p50"]
    for noise in noisy["noise_floor"]:
        noise["ci95"] = [0.8, 1.1]
    assert {c.threshold for c in compared(noisy, noisy).changes if c.client == "wire"} == {1 / 0.8 - 1}
