"""The rate of a robot's clock, from readings that are late and odometry that is slow."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from conformance.packs.table1.robot.clock import Clock

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
