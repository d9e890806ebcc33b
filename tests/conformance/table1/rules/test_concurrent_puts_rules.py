"""Rules on several clients that put at one moment, by traces made by hand."""

from types import SimpleNamespace

import pytest
from toy_messages import exchange

from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.concurrent_puts import ConcurrentGoal, ConcurrentVelocities, GoalRead
from conformance.packs.table1.robot.drive_trace import Command, Turn
from conformance.packs.table1.robot.robot import STILL, Velocity
from conformance.packs.table1.rules.rest_resources import test_several_clients as rules
from conformance.packs.table1.statement import Statement
from conformance.scenarios.rule import Note
from conformance.verdict.evidence import Case

_STATEMENT = Statement(declared=DeclaredLimits(settle_s=1.0, hold_s=3.0, tolerance_abs=0.02))
_ONE, _OTHER = Velocity(linear_x=0.5, angular_z=-0.5), Velocity(linear_x=-0.5, angular_z=0.5)
_MIXTURE, _NEITHER = Velocity(linear_x=0.5, angular_z=0.5), Velocity(linear_x=0.1)


def _goal(*statuses, differs="", cancelled=("no goal",)):
    reads = tuple(GoalRead(exchange(), one) for one in cancelled)
    return ConcurrentGoal(tuple(map(exchange, statuses)), GoalRead(exchange(), differs), reads)


@pytest.mark.parametrize(
    ("goal", "holds"),
    [
        (_goal(201, 200, 204), [True, True, True]),
        (_goal(202, 202, 202), [True, True, True]),
        (_goal(201, 201, 200), [False, True, True]),
        (_goal(200, 200), [False, True, True]),
        (_goal(201, 409), [False, True, True]),
        (_goal(201, differs="position.x 1 for 2"), [True, False, True]),
        (_goal(201, cancelled=("no goal", "")), [True, True, True, False]),
        (ConcurrentGoal((exchange(201),), None), [True]),
    ],
)
def test_one_goal_of_several_clients_is_one_goal(goal, holds):
    assert [one.holds for one in rules.goal_concurrent.outcomes((goal,), {}.__getitem__)] == holds


def _velocities(*reads, last=False, accepted=(_ONE, _OTHER)):
    made = tuple(Turn(None, at, velocity, exchange()) for at, velocity in reads)
    return ConcurrentVelocities(tuple(Command(one, 0.0, 0.1, exchange()) for one in accepted), 0.0, 0.1, made, last)


@pytest.mark.parametrize(
    ("put", "shown"),
    [
        (_velocities((0.2, STILL), (0.4, _OTHER)), True),
        (_velocities((1.5, _MIXTURE)), False),
        (_velocities((0.5, _MIXTURE)), None),  # the robot has not had its time
        (_velocities((1.5, _NEITHER)), None),  # to be tried again
        (_velocities((1.5, _NEITHER), last=True), False),
        (_velocities((2.9, _NEITHER), last=True), None),  # the velocity may have ended
        (_velocities((1.5, _NEITHER), (1.6, None), last=True), None),  # judged by the observers
        (_velocities(accepted=(), last=True), None),
    ],
)
def test_one_velocity_of_several_clients_is_reached(put, shown):
    run = SimpleNamespace(statement=_STATEMENT)
    outcomes = rules.one_velocity_is_reached.outcomes((put,), {"run": run}.__getitem__)
    assert [one.holds for one in outcomes if isinstance(one, Case)] == ([] if shown is None else [shown])
    undecided = put.last and not put.is_decided(_STATEMENT.limits)
    assert any(isinstance(one, Note) for one in outcomes) == undecided
    assert undecided == (put.last and bool(put.reads) and put.reads[-1].at == 2.9)
