"""Did it get slower?"""

import copy
import math

import numpy as np
import pytest

from reports.comparison import compare, judge, ratio_interval
from reports.comparison_pages import comparison_html, comparison_markdown, table, verdict
from reports.errors import ResultsIncompatibleError

NAMES = ("old.json", "new.json")


def scaled(latency, factor, *, interface="soap"):
    """Return a copy in which one interface takes `factor` times as long."""
    changed = copy.deepcopy(latency)
    for series in changed["series"]:
        if series["interface"] != interface:
            continue
        for group in ("service_ms", "response_ms"):
            series[group] = {name: value and value * factor for name, value in series[group].items()}
        for group in ("ci95_ms", "response_ci95_ms"):
            series[group] = {name: value and [v * factor for v in value] for name, value in series[group].items()}
    return changed


def compared(old, new, threshold=0.05):
    return compare(old, new, NAMES, threshold)


def test_same_result_is_no_change(latency):
    found = compared(latency, latency)
    assert not found.slower
    assert {change.verdict for change in found.changes} <= {"same", "unclear", "no figure"}
    assert all(change.ratio == 1.0 for change in found.changes)
    assert verdict(found).words.startswith("No change")


def test_slower_is_found_where_it_is(latency):
    found = compared(latency, scaled(latency, 1.2))
    assert found.slower
    slower = found.with_verdict("slower")
    assert {change.interface for change in slower} == {"soap"}
    assert slower[0].ratio == pytest.approx(1.2)
    assert slower[0].interval[0] < 1.2 < slower[0].interval[1]
    assert verdict(found).words == "It got slower"


def test_faster_is_no_failure(latency):
    found = compared(latency, scaled(latency, 0.7))
    assert not found.slower
    assert found.with_verdict("faster")
    assert verdict(found).words == "It got faster"


@pytest.mark.parametrize(("threshold", "slower"), [(0.05, True), (0.15, True), (0.25, False)])
def test_threshold(latency, threshold, slower):
    assert compared(latency, scaled(latency, 1.2), threshold).slower is slower


def test_noise_floor_raises_the_threshold(latency):
    noisy = scaled(latency, 1.2)
    for noise in noisy["noise_floor"]:
        noise["ci95"] = [0.7, 1.3]
    found = compared(latency, noisy)
    thresholds = {c.threshold for c in found.changes if c.quantile == "p50" and c.client == "wire"}
    assert thresholds == {1 / 0.7 - 1}
    assert not [change for change in found.with_verdict("slower") if change.client == "wire"]


@pytest.mark.parametrize(
    ("interval", "expected"),
    [
        (None, "no figure"),
        ((1.06, 1.2), "slower"),
        ((1.04, 1.2), "unclear"),
        ((0.99, 1.01), "same"),
        ((0.8, 0.94), "faster"),
        ((0.9, 1.1), "unclear"),
    ],
)
def test_judgement(interval, expected):
    assert judge(interval, 0.05) == expected


def test_ratio_interval_is_that_of_independent_estimates():
    old, new, arm_old, arm_new = 1.0, 1.5, 0.03, 0.04
    low, high = ratio_interval(
        old,
        (old * math.exp(-arm_old), old * math.exp(arm_old)),
        new,
        (new * math.exp(-arm_new), new * math.exp(arm_new)),
    )
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
    [
        (None, [1, 2], 1.0, [1, 2]),
        (1.0, None, 1.0, [1, 2]),
        (0.0, [0, 0], 1.0, [1, 2]),
        (1.0, [0, 2], 1.0, [1, 2]),
    ],
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
    other["knee"][0]["highest_rate"] = 2000
    told = " ".join(compared(latency, other).remarks)
    for wanted in ("cpu was Example CPU", "More requests failed", "Only in the old result", "now holds up to 2,000"):
        assert wanted in told


def test_invalid_result_gives_no_answer(latency):
    other = copy.deepcopy(latency)
    other.update(valid=False, invalid_because=["generator CPU at 97 %"])
    found = compared(latency, other)
    assert not found.valid
    assert "generator CPU at 97 %" in verdict(found).sentence


def test_pages_draw_both(latency):
    latency["series"] = latency["series"][:2]
    found = compared(latency, scaled(latency, 1.2))
    source = comparison_html(found, NAMES)
    assert len(source) < 1_500_000
    assert 'id="change-figure"' in source
    assert 'id="ratios-figure"' in source
    assert "It got slower" in source
    assert "It got slower" in comparison_markdown(found, NAMES)


def test_table_is_aligned(latency):
    lines = table(compared(latency, latency)).split("\n")
    assert len(lines) == 33
    assert len({line.index("%") for line in lines[1:]}) == 1
