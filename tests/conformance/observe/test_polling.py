"""Polling by a simulated clock: as often as asked, and once more after the end."""

from driven_device import SimulatedClock

from conformance.observe.clock import Patience, poll_for
from conformance.transport.pace import Pace


def test_it_looks_so_often_and_once_when_the_time_is_over():
    clock = SimulatedClock(0.0)
    assert [round(clock.now(), 3) for _ in poll_for(clock, 0.1, 0.35)] == [0.0, 0.1, 0.2, 0.3, 0.4]


def test_a_turn_that_takes_long_delays_the_next_and_is_not_the_last():
    clock, turns = SimulatedClock(0.0), []
    for _ in poll_for(clock, 0.1, 0.35):
        turns.append(clock.now())
        clock.sleep(5.0)
    assert turns == [0.0, 5.0]


def test_late_responses_are_given_back():
    clock, pace = SimulatedClock(0.0), Pace(0.001)
    patience = Patience(pace, 1.0, clock)
    clock.sleep(1.5)
    assert patience.over
    pace.took(1.0, 0)
    assert not patience.over
