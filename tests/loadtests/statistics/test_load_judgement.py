"""What may be claimed, and what counts: pure functions on made-up figures."""

import numpy as np
import pytest

from loadtests.schedule.plan import Load, Plan
from loadtests.statistics.comparisons import judge
from loadtests.statistics.figures import series
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Recorder
from loadtests.statistics.rounds import lag_correlation


@pytest.mark.parametrize(
    ("ratio", "effect", "noise", "verdict", "bound"),
    [
        (1.47, (1.40, 1.55), (0.97, 1.03), "differs", None),
        (0.68, (0.65, 0.71), (0.97, 1.03), "differs", None),
        (1.47, (1.40, 1.55), (0.9, 1.48), "noise", 1.55),
        (1.02, (0.98, 1.06), (0.97, 1.03), "noise", 1.06),
        (1.47, (1.40, 1.55), (1.04, 1.10), "bounded", 1.299),
        (0.68, (0.65, 0.71), (1.04, 1.10), "bounded", 0.7657),
        (1.06, (1.02, 1.10), (1.04, 1.10), "noise", 1.10 * 1.10),
        (1.10, (1.08, 1.12), (1.001, 1.05), "bounded", 1.041),
        (1.05, (1.03, 1.07), (1.001, 1.05), "noise", 1.07 * 1.05),
        (1.3, (0.6, 2.9), (0.97, 1.03), "none", 2.9),
        (1.3, None, (0.97, 1.03), "none", None),
        (1.3, (1.2, 1.4), None, "none", None),
    ],
)
def test_the_a_a_run_decides_what_may_be_claimed(ratio, effect, noise, verdict, bound):
    found = judge(ratio, effect, noise)
    assert found.verdict == verdict
    assert found.bound == (bound if bound is None else pytest.approx(bound, abs=1e-3))
    assert (found.reason is None) == (verdict == "differs")


def test_what_failed_or_never_started_counts_as_no_less_than_the_slowest_answer():
    load = Load(rate=400.0, users=None, duration_s=20.0, warmup_s=0.0, arrivals="constant", seed=1)
    plan = Plan(("pose",), ("rest",), ("wire",), load, timeout_s=10.0, workers=1, connections=300)
    recorder = Recorder(plan.series_of())
    for number in range(1000):
        recorder.record(0, 0, 0, 0, 0, 0, 1_000_000 + number * 1000, -1)
    for _ in range(15):
        recorder.fail(0, 0, "status", "503", 0, (100_000, 100_000))  # at once: that makes nobody quick
    recorder.drop(0, 0, 3_000_000_000)
    recorder.flush()
    (entry,) = series(Measured([plan], Recorder.unpack(recorder.take())), {})
    assert (entry.count, entry.errors, entry.dropped, entry.counted) == (1000, 15, 1, 1016)
    assert entry.service_ms["p99"] == pytest.approx(1.999, rel=2e-3)
    assert entry.service_ms["max"] == 3000
    assert entry.service_ms["p50"] > 1.5
    assert entry.at_least == ["mean", "p99", "max"]


def test_the_correlation_of_neighbours_is_that_of_the_series():
    rng = np.random.default_rng(1)
    values = np.zeros(4000)
    for index in range(1, len(values)):
        values[index] = 0.6 * values[index - 1] + rng.normal()
    assert lag_correlation(values, np.zeros(4000, dtype=int)) == pytest.approx(0.6, abs=0.05)
    assert lag_correlation(values, np.arange(4000)) is None, "no neighbours within a repeat"
