"""Rules on stops and watchdogs, by traces made by hand."""

from dataclasses import replace

import pytest
from toy_messages import exchange

from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.drive_trace import Trace, Turn
from conformance.packs.table1.robot.goal_trace import Cancelled, GoalLife
from conformance.packs.table1.robot.letting_go import LetGo
from conformance.packs.table1.robot.robot import STILL, Velocity
from conformance.packs.table1.rules.safety import test_driving as rules
from conformance.packs.table1.scenarios.trace import Driven
from conformance.packs.table1.statement import Statement
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

_FAST = Velocity(linear_x=0.3)


def _took(seconds: float) -> Exchange:
    answered = exchange(204)
    return replace(answered, response=replace(answered.response, elapsed_ms=1000 * seconds))


def _outcomes(rule, trace):
    run = Run(statement=Statement(declared=DeclaredLimits(settle_s=0.6, hold_s=1.0)))
    return rule.outcomes(trace, {"run": run}.__getitem__)


@pytest.mark.parametrize(
    ("took", "holds"),
    [
        ((), []),
        ((0.01,), [True]),
        ((1.5,), [True]),  # a robot that waits until it is at rest
        ((9.0,), [None]),  # a lost packet
        ((9.0, 0.01), [True]),
        ((9.0, 0.01, 9.0), [False]),
        ((9.0, 9.0, 9.0), [False]),
    ],
)
def test_a_stop_is_answered_in_time(took, holds):
    found = _outcomes(rules.cancel_answered, GoalLife(cancels=tuple(map(_took, took))))
    assert [one.holds if isinstance(one, Case) else None for one in found] == holds


def _let_go(*velocities: Velocity) -> LetGo:
    turns = tuple(Turn(None, 0.3 * index, one, exchange(), None, exchange()) for index, one in enumerate(velocities))
    return LetGo(_FAST, 0.0, 0.02, turns)


def test_a_watchdog_that_fails_once_fails():
    stops, goes_on = _let_go(_FAST, STILL, STILL, STILL), _let_go(*[_FAST] * 9)
    found = _outcomes(rules.watchdog, Driven(Trace(0.0), ((goes_on, stops), (stops,))))
    assert [one.holds for one in found] == [False, True, True]


def test_a_cancel_whose_response_was_late_is_judged_only_where_no_other_was_in_time():
    late, in_time = (Cancelled(exchange(204), exchange(404), gone=True, drive=Trace(0.0), late=one) for one in (1, 0))
    assert rules.judged(GoalLife(cancelled=(late, in_time))) == (in_time,)
    assert rules.judged(GoalLife(cancelled=(late, late))) == (late,)
    assert rules.judged(GoalLife()) == ()
