"""When a load test ends: a comparison of two robots while it is undecided, and a robot that counts as dead."""

import numpy as np
import pytest

from loadtests.engine.planning import until_decided
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.plan import Load, Plan
from loadtests.settings.settings import Against
from loadtests.statistics.against import NOT_SLOWER, SLOWER, UNCLEAR, Change, Judge, against
from loadtests.statistics.comparisons import aa_controls
from loadtests.statistics.measured import Measured
from loadtests.statistics.overload import Liveness
from loadtests.statistics.recorder import Recorder

LOAD = Load(rate=200.0, users=None, duration_s=10.0, warmup_s=0.5, arrivals="constant", seed=1)
PLAN = Plan(("pose",), ("rest",), ("wire",), LOAD, timeout_s=10.0, workers=1, connections=32, robots=2)
OTHER = Against(None, 0.05, (1, 2, 4))


class Bench:
    """Carries out plans by making up service times: lognormal, the median of this robot's times `slower` the other's.

    Args:
        scatter: standard deviation of the logarithm.
        slower: by which factor this robot is slower.
    """

    def __init__(self, scatter, slower=1.0):
        self.scatter, self.slower = scatter, slower
        self.recorder = Recorder(PLAN.series_of())
        self.plans = []
        self.rng = np.random.default_rng(3)

    def carry_out(self, plan):
        schedule = Schedule(plan, 0, 1)
        self.recorder.series_of.update(plan.series_of())
        for index, segment in enumerate(plan.segments):
            median_ms = 1.0 if segment.robot else self.slower
            for due, operation, _ in schedule.arrivals(index):
                done = due + int(1e6 * median_ms * np.exp(self.rng.normal(0, self.scatter)))
                self.recorder.record(plan.first_segment + index, operation, due, due, due, done, done, -1)
        self.plans.append(plan)

    def decided(self, is_over=lambda: False):
        self.carry_out(PLAN)
        return until_decided(PLAN, OTHER, self.recorder, 0.01, self.carry_out, is_over, lambda _: None)

    @property
    def verdict(self):
        self.recorder.flush()
        measured = Measured(self.plans, self.recorder)
        return against(measured, aa_controls(measured), 0.05, 3, {}, 0.01).verdict


@pytest.mark.parametrize(("slower", "verdict"), [(1.0, NOT_SLOWER), (1.3, SLOWER)])
def test_what_is_decided_takes_no_longer(slower, verdict):
    bench = Bench(0.2, slower)
    assert bench.decided().part == 0
    assert bench.verdict == verdict


def test_what_is_undecided_is_measured_on_and_all_of_it_counts():
    bench = Bench(0.35)
    last, plans = bench.decided(), bench.plans
    assert [plan.part for plan in plans] == [0, 1]
    assert (last, bench.verdict) == (plans[-1], NOT_SLOWER)
    assert plans[1].first_segment == len(PLAN.segments)
    assert plans[1].load.warmup_s == 0
    measured = Measured(plans, bench.recorder)
    assert measured.repeats == [0]
    name = ("pose", "rest", "wire")
    assert len(measured.pairs("duel", name)) == 2 * len(Measured(plans[:1], bench.recorder).pairs("duel", name))


def test_what_cannot_be_decided_ends_after_four_times_the_duration():
    bench = Bench(3.0)
    assert (bench.decided().part, bench.verdict) == (3, UNCLEAR)


def test_nothing_more_is_measured_once_the_run_is_over():
    assert Bench(3.0).decided(is_over=lambda: True).part == 0


def change(ratio, ci95, parts=()):
    found = Change(**dict.fromkeys(Change.__struct_fields__) | {"ratio": ratio, "ci95": ci95, "parts": list(parts)})
    found.judge([0.9, 1.1], 0.01)
    return found


def test_who_is_judged_several_times_has_wider_intervals():
    assert Judge(0.05, 2).verdict(change(1.0, [0.97, 1.045])) == NOT_SLOWER
    assert Judge(0.05, 2, looks=3).verdict(change(1.0, [0.97, 1.045])) == UNCLEAR
    assert Judge(0.05, 2).verdict(change(1.2, [1.08, 1.3])) == SLOWER
    assert Judge(0.05, 2, looks=3).verdict(change(1.2, [1.08, 1.3])) == UNCLEAR


def test_a_robot_is_slower_only_if_all_parts_of_the_run_show_it():
    assert Judge(0.05, 2).verdict(change(1.2, [1.08, 1.3], [1.1, 1.3, 1.2, 1.15, 1.4, 1.2])) == SLOWER
    assert Judge(0.05, 2).verdict(change(1.2, [1.08, 1.3], [1.9, 0.9, 1.2, 1.0, 2.4, 1.2])) == UNCLEAR


@pytest.mark.parametrize("report_s", [0.0, 1.0])
def test_a_robot_is_dead_when_nothing_succeeds_for_three_seconds_though_much_is_tried(report_s):
    liveness = Liveness(report_s)
    assert liveness.dead_since(1.0, succeeded=50, failed=0) is None
    assert liveness.dead_since(2.0, succeeded=50, failed=40) is None
    assert liveness.dead_since(4.0 + report_s, succeeded=50, failed=99) is None
    assert liveness.dead_since(4.1 + report_s, succeeded=50, failed=100) == 1.0


def test_a_robot_that_is_asked_little_or_answers_again_is_not_dead():
    liveness = Liveness(0.0)
    assert liveness.dead_since(9.0, succeeded=0, failed=9) is None
    assert liveness.dead_since(11.0, succeeded=0, failed=20) is None
    assert liveness.dead_since(11.9, succeeded=1, failed=30) is None
    assert liveness.dead_since(14.0, succeeded=1, failed=60) is None


def test_looking_is_due_twice_a_second():
    liveness = Liveness(0.0)
    liveness.dead_since(1.0, 0, 0)
    assert not liveness.is_due(1.4)
    assert liveness.is_due(1.5)
