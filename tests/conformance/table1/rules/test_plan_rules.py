"""Rules on plans, by traces made by hand."""

import re
from types import SimpleNamespace

import pytest
from toy_messages import exchange

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.plan import NOTATIONS, Plan, Start
from conformance.packs.table1.rules.rest_resources import test_plan as rules
from conformance.packs.table1.scenarios.plans import DefaultPlan, FramePlan, PlanRead, PlansFromRobot, PlansFromStart
from conformance.packs.table1.statement import Statement

_HERE, _THERE, _ASIDE = Pose(0.0, 0.0, 0.0), Pose(0.9, 0.0, 0.0), Pose(0.9, 0.5, 0.0)
_RUN = {"run": SimpleNamespace(statement=Statement())}


def _plan(*poses, frame="map"):
    return Plan(frozenset({frame}), poses or (_HERE, _THERE))


def _holds(rule, trace):
    return [one.holds for one in rule.outcomes(trace, _RUN.__getitem__)]


def test_a_response_without_a_plan_is_judged_by_its_type_only():
    reads = (PlanRead(exchange(), ""), PlanRead(exchange(500), "status 500"))
    assert _holds(rules.plan_type, PlansFromRobot(reads)) == [True, False]
    assert _holds(rules.plan_type, PlansFromStart(reads)) == [True, False]
    assert _holds(rules.plan_start, PlansFromRobot(reads)) == []


def test_a_robot_without_any_plan_fails():
    assert _holds(rules.plan_type, PlansFromRobot(nowhere=exchange(422))) == [False]


@pytest.mark.parametrize(("beyond_m", "holds"), [((-0.1,), True), ((0.3, 0.3, 0.3), False), ((0.3, -0.1, -0.1), True)])
def test_a_plan_begins_at_the_robot(beyond_m, holds):
    start = Start(_ASIDE, _HERE, exchange(), beyond_m)
    trace = PlansFromRobot((PlanRead(exchange(), "", start),))
    assert _holds(rules.plan_start, trace) == [holds]


@pytest.mark.parametrize(
    ("plan", "holds"),
    [
        (_plan(), True),
        (_plan(_HERE, _ASIDE), False),
        (_plan(_HERE, _THERE._replace(yaw=1.0)), False),
        (_plan(frame="odom"), False),
        (_plan(_ASIDE, _THERE), False),
        (None, False),
    ],
)
def test_what_a_request_leaves_out_or_writes_otherwise_gives_the_same_plan(plan, holds):
    default = DefaultPlan(_THERE, exchange(), "" if plan else "status 500", plan, _plan())
    assert _holds(rules.plan_defaults, PlansFromStart(defaults=(default,))) == [holds]
    assert _holds(rules.plan_numbers, PlansFromStart(written=(default,))) == [holds]


@pytest.mark.parametrize("value", [0.0, -0.0, 0.1, -0.75, 12.5, -41.35, 1e-9])
def test_each_notation_is_allowed_and_gives_the_same_number(value):
    for write in NOTATIONS:
        written = write(value)
        assert re.fullmatch(r"[+-]?(\d+(\.\d+)?|\.\d+)(e[+-]\d+)?", written, re.ASCII), written
        assert float(written) == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize(
    ("status", "plan", "moved_m", "answered", "starts"),
    [
        (200, _plan(frame="odom"), 0.0, True, [True]),
        (200, _plan(_ASIDE, _THERE, frame="odom"), 0.0, True, [False]),
        (200, _plan(_ASIDE, _THERE, frame="odom"), 1.0, True, [True]),
        (200, _plan(), 0.0, True, []),
        (200, _plan(frame="odom"), None, True, []),
        (422, None, None, True, []),
        (500, None, None, False, []),
    ],
)
def test_a_plan_in_another_frame_is_there_or_refused(status, plan, moved_m, answered, starts):
    trace = (FramePlan("odom", _HERE, exchange(status), "" if plan else f"status {status}", plan, moved_m),)
    assert _holds(rules.plan_in_its_frame, trace) == [answered]
    assert _holds(rules.plan_starts_in_its_frame, trace) == starts


@pytest.mark.parametrize(("status", "holds"), [(422, True), (404, False), (200, False), (500, False)])
def test_there_is_no_plan_outside_every_map(status, holds):
    assert _holds(rules.plan_none, (exchange(status),)) == [holds]
