"""Whether a velocity is reached in time and lasts as long as it is renewed, also where whoever looks is held up."""

import pytest
from clocked import SAMPLE_S, SETTLE_S, WANTED, Body, Drive
from driven_device import SimulatedClock

from conformance.packs.table1.robot.robot import STILL
from conformance.packs.table1.robot.undisturbed import renewed

_CONVERGES = "rest-resources/velocity-converges"


def _judged(
    takes_s: float, looks: dict[int, float] | None = None, hold_s: float = 10.0, *, loses: bool = False
) -> bool:
    """Whether a robot that takes so long is said to have reached the velocity."""
    clock = SimulatedClock()
    driven = Drive(Body(clock, takes_s, hold_s, loses=loses), looks or {}, hold_s)
    driven.tell()
    driven.reach(WANTED, _CONVERGES)
    return driven.judged[_CONVERGES]


@pytest.mark.parametrize("takes_s", [0.5 * SETTLE_S, SETTLE_S - SAMPLE_S, SETTLE_S])
def test_a_velocity_is_reached_in_its_settle_time_and_seen_with_the_next_odometry(takes_s):
    assert _judged(takes_s)


@pytest.mark.parametrize("late_s", [0.6, 0.7, 0.8, 1.2, 3.0])
def test_samples_from_within_the_settle_time_say_nothing_of_a_robot_that_was_looked_at_too_late(late_s):
    # Fifty looks while it still had time, then nothing until after the end.
    assert _judged(SETTLE_S, {50: late_s})


def test_one_that_ends_again_and_again_before_it_can_be_renewed_is_not_blamed():
    clock = SimulatedClock()
    driven = Drive(Body(clock, SETTLE_S, 0.3), dict.fromkeys(range(400), 0.4), 0.3)
    driven.tell()
    assert not driven.reach(WANTED, _CONVERGES)
    assert driven.judged == {}


def test_a_velocity_that_ended_because_it_was_renewed_too_late_has_its_settle_time_again():
    assert _judged(SETTLE_S, {5: 1.6}, hold_s=1.0)


@pytest.mark.parametrize("hold_s", [1.65, 10.0])
def test_a_command_that_was_lost_is_not_made_up_for_by_its_renewal(hold_s):
    assert not _judged(0.1 * SETTLE_S, hold_s=hold_s, loses=True)


@pytest.mark.parametrize("looks", [{}, {50: 0.6}, {5: 1.6}, dict.fromkeys(range(100), 0.7)])
@pytest.mark.parametrize("hold_s", [1.0, 10.0])
def test_a_robot_that_takes_twice_its_settle_time_is_refuted(looks, hold_s):
    assert not _judged(3 * SETTLE_S, looks, hold_s)


def test_rest_that_no_velocity_brings_about_is_waited_for_as_long():
    # A goal was cancelled: there is no command to be renewed.
    clock = SimulatedClock()
    body = Body(clock, 0.0, 10.0)
    body.tell()
    driven = Drive(body, {}, 1.0)
    driven.reach(STILL, "safety/cancel", since=clock.now())
    assert (driven.judged, driven.trace.commands) == ({"safety/cancel": False}, ())


@pytest.mark.parametrize(("usual_s", "judged"), [(0.2, {_CONVERGES: False}), (0.3, {}), (0.4, {})])
def test_what_ends_before_it_can_be_read_is_not_held_against_the_robot(usual_s, judged):
    clock = SimulatedClock()
    driven = Drive(Body(clock, 20 * SETTLE_S, 1.0), dict.fromkeys(range(100), 3 * usual_s), 1.0, usual_s)
    driven.tell()
    assert not driven.reach(WANTED, _CONVERGES)
    assert driven.judged == judged
    assert driven.trace.reaches[-1].outlasted is not bool(judged)


_RENEWAL, _REFUSED = "safety/renewal", "safety/refused-keeps"
_HOLD_S = 2.0


def _renewing(usual_s: float = 0.001, looks: dict[int, float] | None = None, **faults: bool) -> Drive:
    driven = Drive(Body(SimulatedClock(), 0.1 * SETTLE_S, _HOLD_S, **faults), looks or {}, _HOLD_S, usual_s)
    driven.refresh(WANTED)
    renewed(driven.robot, driven, WANTED)
    return driven


def test_a_good_robot_keeps_its_velocity():
    assert _renewing().judged == {_RENEWAL: True, _REFUSED: True}


def test_one_look_is_enough_for_it():
    # Little more than the time in which one command certainly ends.
    driven = _renewing()
    assert driven.clock.now() - driven.trace.begun < _HOLD_S + 0.6 * SETTLE_S


def test_a_robot_that_renews_nothing_is_refuted_for_that_alone():
    assert _renewing(renews=False).judged == {_RENEWAL: False}


def test_a_robot_that_what_is_refused_stops_is_refuted_for_that_alone():
    assert _renewing(stops=True).judged == {_RENEWAL: True, _REFUSED: False}


@pytest.mark.parametrize("usual_s", [0.05, 0.1, 0.15, 0.3])
@pytest.mark.parametrize("faults", [{}, {"renews": False}])
def test_a_robot_whose_answers_are_slow_is_judged_by_what_can_be_read_in_time(usual_s, faults):
    assert _renewing(usual_s=usual_s, **faults).judged[_RENEWAL] is not bool(faults)


def test_one_that_was_renewed_too_late_is_not_blamed():
    driven = _renewing(looks=dict.fromkeys(range(400), 1.1))
    assert False not in driven.judged.values()
    assert _RENEWAL not in driven.judged


def test_who_is_held_up_many_times_tries_again():
    assert _renewing(looks=dict.fromkeys(range(16), 1.1)).judged[_RENEWAL] is True
