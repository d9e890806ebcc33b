"""Whether a velocity lasts as long as it is renewed, on robots that are asked quickly and slowly, good and faulty."""

import pytest
from clocked import SETTLE_S, WANTED, Body, Clock, Drive

from conformance.packs.table1.robot import drive, undisturbed
from conformance.packs.table1.robot.undisturbed import judge_renewed

_RENEWAL, _REFUSED = "safety/renewal", "safety/refused-keeps"
_HOLD_S = 2.0


def _judged(
    monkeypatch: pytest.MonkeyPatch, usual_s: float = 0.001, looks: dict[int, float] | None = None, **faults: bool
) -> Drive:
    clock = Clock()
    for module in (drive, undisturbed):
        monkeypatch.setattr(module, "time", clock)
    driven = Drive(Body(clock, 0.1 * SETTLE_S, _HOLD_S, **faults), looks or {}, _HOLD_S, usual_s)
    driven.refresh(WANTED)
    judge_renewed(driven.robot, driven, driven.judge, WANTED)
    return driven


def test_a_good_robot_keeps_its_velocity(monkeypatch):
    assert _judged(monkeypatch).judge.judged == {_RENEWAL: True, _REFUSED: True}


def test_one_look_is_enough_for_it(monkeypatch):
    # Little more than the time in which one command certainly ends.
    driven = _judged(monkeypatch)
    assert driven.body.clock.now - driven.trace.begun < _HOLD_S + 0.6 * SETTLE_S


def test_a_robot_that_renews_nothing_is_refuted_for_that_alone(monkeypatch):
    assert _judged(monkeypatch, renews=False).judge.judged == {_RENEWAL: False}


def test_a_robot_that_what_is_refused_stops_is_refuted_for_that_alone(monkeypatch):
    assert _judged(monkeypatch, stops=True).judge.judged == {_RENEWAL: True, _REFUSED: False}


@pytest.mark.parametrize("usual_s", [0.05, 0.1, 0.15, 0.3])
@pytest.mark.parametrize("faults", [{}, {"renews": False}])
def test_a_robot_whose_answers_are_slow_is_judged_by_what_can_be_read_in_time(monkeypatch, usual_s, faults):
    assert _judged(monkeypatch, usual_s=usual_s, **faults).judge.judged[_RENEWAL] is not bool(faults)


def test_one_that_was_renewed_too_late_is_not_blamed(monkeypatch):
    driven = _judged(monkeypatch, looks=dict.fromkeys(range(400), 1.1))
    assert False not in driven.judge.judged.values()
    assert _RENEWAL in driven.judge.skipped


def test_who_is_held_up_many_times_tries_again(monkeypatch):
    driven = _judged(monkeypatch, looks=dict.fromkeys(range(16), 1.1))
    assert driven.judge.judged[_RENEWAL] is True
    assert driven.judge.skipped == []
