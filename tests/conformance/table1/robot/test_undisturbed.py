"""Whether a velocity lasts as long as it is renewed, on robots that are asked quickly and slowly, good and faulty."""

import pytest
from clocked import SETTLE_S, WANTED, Body, Drive

from conformance.observe.clock import SimulatedClock
from conformance.packs.table1.robot.undisturbed import renewed

_RENEWAL, _REFUSED = "safety/renewal", "safety/refused-keeps"
_HOLD_S = 2.0


def _judged(usual_s: float = 0.001, looks: dict[int, float] | None = None, **faults: bool) -> Drive:
    driven = Drive(Body(SimulatedClock(), 0.1 * SETTLE_S, _HOLD_S, **faults), looks or {}, _HOLD_S, usual_s)
    driven.refresh(WANTED)
    renewed(driven.robot, driven, WANTED)
    return driven


def test_a_good_robot_keeps_its_velocity():
    assert _judged().judged == {_RENEWAL: True, _REFUSED: True}


def test_one_look_is_enough_for_it():
    # Little more than the time in which one command certainly ends.
    driven = _judged()
    assert driven.clock.now() - driven.trace.begun < _HOLD_S + 0.6 * SETTLE_S


def test_a_robot_that_renews_nothing_is_refuted_for_that_alone():
    assert _judged(renews=False).judged == {_RENEWAL: False}


def test_a_robot_that_what_is_refused_stops_is_refuted_for_that_alone():
    assert _judged(stops=True).judged == {_RENEWAL: True, _REFUSED: False}


@pytest.mark.parametrize("usual_s", [0.05, 0.1, 0.15, 0.3])
@pytest.mark.parametrize("faults", [{}, {"renews": False}])
def test_a_robot_whose_answers_are_slow_is_judged_by_what_can_be_read_in_time(usual_s, faults):
    assert _judged(usual_s=usual_s, **faults).judged[_RENEWAL] is not bool(faults)


def test_one_that_was_renewed_too_late_is_not_blamed():
    driven = _judged(looks=dict.fromkeys(range(400), 1.1))
    assert False not in driven.judged.values()
    assert _RENEWAL not in driven.judged


def test_who_is_held_up_many_times_tries_again():
    driven = _judged(looks=dict.fromkeys(range(16), 1.1))
    assert driven.judged[_RENEWAL] is True
