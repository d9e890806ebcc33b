"""Single readings, and the rate of a robot's clock, from readings that are late and odometry that is slow."""

import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_messages import exchange, odometry

from conformance.packs.table1.checkers.state import BesideOdometry, OneSample, Place
from conformance.packs.table1.limits import DeclaredLimits, Noise
from conformance.packs.table1.robot.clock import Clock
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.robot import STILL, Velocity
from conformance.scenarios.rule import record
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run

_EXCHANGE = exchange()
_ID = "rest-resources/velocity-odometry"
_SAMPLE = "rest-resources/pose-sample"
_FAST = Velocity(linear_x=0.3)
_TURN_S = 0.02


class _Run:
    """Odometry and another value read in turns, each turn a sample of the odometry, unless it has fewer."""

    def __init__(self, sample_s: float = _TURN_S, **declared: object) -> None:
        self.judge: Judge = Run().judge
        self.beside = BesideOdometry[Any](DeclaredLimits(tolerance_abs=0.02, **declared).resolve())
        self.sample_s, self.now = sample_s, 100.0

    def turns(self, count: int, odometry: Any = STILL, velocity: Any = None) -> None:
        for _ in range(count):
            stamp = self.now // self.sample_s * self.sample_s
            record(self.judge, _ID, self.beside.odometry(stamp, odometry, self.now))
            self.beside.reading(odometry if velocity is None else velocity, _EXCHANGE, self.now + 0.005)
            self.now += _TURN_S

    @property
    def refuted(self) -> int:
        return self.judge.failure_counts().get(_ID, 0)

    @property
    def cases(self) -> int:
        return self.judge.counts([_ID])[_ID]


def test_a_reading_that_is_out_again_is_judged_from_the_second_on():
    run = _Run()
    for number in range(4):
        run.turns(60)
        run.turns(1, velocity=_FAST)
        assert run.refuted == max(0, number - 1)
    run.turns(2)
    assert run.refuted == 3


@pytest.mark.parametrize("yaw", [3.0, -3.0])
def test_a_pose_is_compared_at_any_heading(yaw):
    run, here = _Run(), Place.of(Pose(1.0, 2.0, yaw))
    run.turns(60, here)
    assert run.cases > 30
    assert run.refuted == 0
    run.turns(3, here, Place.of(Pose(1.0, 2.0, -yaw)))
    run.turns(2, here)
    assert run.refuted == 2


@pytest.mark.parametrize("sample_s", [0.02, 0.05, 0.1])
def test_a_pose_between_two_samples_is_no_fault(sample_s):
    run = _Run(sample_s)
    for turn in range(400):
        at = turn * _TURN_S
        sampled = 2.5 * (at // sample_s * sample_s)
        run.turns(1, Place.of(Pose(0.1, 0.2, sampled)), Place.of(Pose(0.1, 0.2, 2.5 * at)))
    assert run.cases > 10
    assert run.refuted == 0


@pytest.mark.parametrize("sample_s", [0.02, 0.05, 0.2])
def test_readings_of_the_odometrys_samples_are_judged_and_fine(sample_s):
    run = _Run(sample_s)
    run.turns(60)
    run.turns(60, _FAST)
    assert run.cases > 40
    assert run.refuted == 0


def test_a_sample_that_is_out_is_everybodys():
    run = _Run()
    for _ in range(10):
        run.turns(40)
        run.turns(1, _FAST)
    assert run.refuted == 0


def test_a_sample_that_was_not_read_may_be_the_one_that_is_out():
    run = _Run()
    run.turns(20)
    for _ in range(10):
        run.turns(40)
        # Of the samples that passed meanwhile the velocity's is one.
        run.now += 0.08
        run.turns(1, velocity=_FAST)
        run.now += 0.08
    assert run.refuted == 0


def test_a_velocity_that_is_smoothed_comes_to_rest_later():
    run = _Run()
    for _ in range(10):
        run.turns(40, _FAST)
        run.turns(18, STILL, velocity=Velocity(linear_x=0.1))
        run.turns(40)
    assert run.refuted == 0


def test_noise_is_no_fault():
    run = _Run(noise=Noise(linear_m_s=0.03))
    for _ in range(10):
        run.turns(40)
        run.turns(1, velocity=Velocity(linear_x=0.1))
    assert run.refuted == 0


def test_what_lies_between_what_the_odometry_had_is_a_velocity_that_was_smoothed():
    run = _Run()
    run.turns(60)
    for _ in range(10):
        run.turns(5, _FAST, velocity=Velocity(linear_x=0.12))
        run.turns(40, _FAST)
        run.turns(40)
    assert run.refuted == 0


def test_a_velocity_that_is_gone_while_the_robot_drives_is_judged():
    run = _Run()
    for _ in range(4):
        run.turns(60, _FAST)
        run.turns(1, _FAST, velocity=STILL)
    run.turns(2, _FAST)
    assert run.refuted == 3


@pytest.mark.parametrize(
    ("told", "cases", "failures"),
    [
        ([(1, 0.0), (1, 0.0), (1, 0.0), (1, 0.0)], 2, 0),
        ([(1, 0.0), (1, 1.0), (1, 0.0)], 1, 1),
        ([(1, 0.0), (1, 0.01), (1, 0.0)], 1, 0),
        # Another sample; and a pose of the moment under a stamp that is coarse.
        ([(1, 0.0), (2, 1.0), (3, 0.0), (3, 0.0)], 0, 0),
        ([(1, 0.0), (1, 0.01), (1, 0.02), (1, 0.03)], 0, 0),
        ([(1, 0.0), (1, 0.0), (2, 1.0), (2, 1.0), (2, 1.0)], 1, 0),
    ],
)
def test_one_sample_is_told_in_one_way(told, cases, failures):
    judge: Judge = Run().judge
    sample = OneSample(DeclaredLimits(tolerance_abs=0.02).resolve())
    for stamp, x in told:
        record(judge, _SAMPLE, sample.odometry((stamp, 0), odometry(x=x), _EXCHANGE))
    assert judge.counts([_SAMPLE])[_SAMPLE] == cases
    assert judge.failure_counts().get(_SAMPLE, 0) == failures


_EPOCH = 1_700_000_000.0
seeds = st.integers(0, 10_000)


def clock(rate: float, seconds: float, seed: int, hz: float = 5.0, *, jump: float = 0.0, unit: float = 1.0) -> Clock:
    """A clock that was read a dozen times a second; the part below a second is in a unit of so many."""
    by, told = random.Random(seed), Clock()  # noqa: S311 - no secret
    at = by.uniform(0, 1)
    begun = at
    while at < begun + seconds:
        sample = int(at * hz) / hz
        late = 0.3 if by.random() < 0.02 else by.uniform(0, 0.01)
        shown = _EPOCH + rate * sample + (jump if at > begun + seconds / 2 else 0.0)
        told.take(at + late, shown // 1 + shown % 1 * unit)
        at += by.uniform(0.02, 0.15)
    return told


@given(seeds, st.floats(6.0, 60.0), st.sampled_from((5.0, 20.0, 50.0)))
def test_a_clock_that_goes_right_is_not_blamed(seed, seconds, hz):
    assert clock(1.0, seconds, seed, hz).is_right(1.0)


@given(seeds, st.floats(6.0, 60.0), st.sampled_from((0.9, 1.1, 2.0, 0.0, -1.0)))
def test_a_clock_that_goes_wrong_is_seen(seed, seconds, rate):
    told = clock(rate, seconds, seed)
    assert not told.is_right(1.0)
    assert told.rate == pytest.approx(rate, abs=0.05)


def test_a_simulation_may_declare_another_scale():
    assert clock(2.0, 10.0, 1).is_right(2.0)
    assert not clock(1.0, 10.0, 1).is_right(2.0)


def test_how_far_a_clock_is_ahead_of_date():
    told = Clock()
    assert told.ahead_s is None
    for seconds, date in ((9.5, "Thu, 01 Jan 1970 00:00:02 GMT"), (0.0, "yesterday"), (0.0, ""), (9.0, "two, dates")):
        told.add(seconds, date)
    assert told.ahead_s == 7.5


def test_too_short_a_time_says_nothing():
    assert Clock().rate is None
    assert clock(1.0, 4.5, 1).rate is None


@given(seeds, st.floats(6.0, 60.0), st.sampled_from((1.0, 2.0, 5.0, 20.0, 50.0)), st.sampled_from((0.0, 3600.0, -40.0)))
def test_a_right_clock_does_not_stand_within_a_second(seed, seconds, hz, jump):
    assert not clock(1.0, seconds, seed, hz, jump=jump).stands_between(1.0)


@pytest.mark.parametrize("hz", [20.0, 50.0])
@pytest.mark.parametrize("unit", [1e-3, 1e-6])
def test_nanoseconds_in_another_unit_are_seen(hz, unit):
    missed = [seed for seed in range(100) if not clock(1.0, 8.0, seed, hz, unit=unit).stands_between(1.0)]
    assert len(missed) <= 1, "one look in some thousands does not show it"
