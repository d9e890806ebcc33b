"""Rules on goals, by traces made by hand."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest
from toy_messages import exchange, goal

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import SUCCEEDED, outcome_fault
from conformance.packs.table1.robot.goal_trace import (
    FarGoal,
    GoalLife,
    GoalReached,
    GoalStep,
    Put,
    RefusedGoals,
    SpecialGoal,
)
from conformance.packs.table1.robot.robot import GOAL_PATH
from conformance.packs.table1.rules.rest_resources import test_goals as rules
from conformance.packs.table1.rules.strict_input import test_refused_state as refused
from conformance.packs.table1.scenarios.refused_again import DuringGoal, RefusedAgain
from conformance.packs.table1.statement import Statement
from conformance.verdict.evidence import Case

_RUN = {"run": SimpleNamespace(statement=Statement())}


def _last(id_, code):
    stamp = {"sec": 1, "nanosec": 0}
    return {"goal_id": {"id": id_, "stamp": stamp}, "status": {"code": code, "text": ""}}


def _holds(rule, trace):
    return [one.holds for one in rule.outcomes(trace, {}.__getitem__)]


@pytest.mark.parametrize(
    ("status", "refused", "accepted"), [(201, False, True), (422, True, False), (500, False, False)]
)
def test_a_special_goal_is_refused_or_accepted(status, refused, accepted):
    put = (SpecialGoal("a quaternion of length 2", exchange(status)),)
    assert _holds(rules.goal_quaternion, RefusedGoals(not_unit=put)) == [refused]
    assert _holds(rules.goal_frame, RefusedGoals(unknown_frames=put)) == [refused]
    assert _holds(rules.goal_quaternion_taken, RefusedGoals(unit=put)) == [accepted]


@pytest.mark.parametrize(
    ("status", "read", "holds", "observed"),
    [
        (422, None, True, "status 422"),
        (500, None, False, "status 500"),
        (202, 404, True, "status 202"),
        (202, 200, False, "a goal that is active 60 s later"),
    ],
)
def test_a_goal_outside_every_map_is_refused_or_ends(status, read, holds, observed):
    far = FarGoal(exchange(status), None if read is None else exchange(read), 60.0)
    (case,) = rules.goal_unreachable.outcomes(RefusedGoals(far=(far,)), {}.__getitem__)
    assert (case.holds, case.observed) == (holds, observed)


@pytest.mark.parametrize(
    ("status", "differs", "holds"),
    [(200, "", True), (422, "", True), (201, "", False), (500, "", False), (204, "status 404", False)],
)
def test_a_goal_is_put_back_without_effect(status, differs, holds):
    put = Put(exchange(status), {}, None, exchange(200), differs, ended=False)
    assert _holds(rules.goal_put_back, GoalLife(put_back=(put,))) == [holds]


@pytest.mark.parametrize(
    ("at_s", "took_s", "holds"),
    [
        (98.0, 0.1, [True, True]),
        (0.0, 0.1, [True, False]),
        (92.0, 1.0, [True, False]),
        (92.0, 9.0, [True, True]),
        (106.0, 9.0, [True, False]),
        (None, 0.1, [True]),
    ],
)
def test_the_robot_fills_in_its_present_time(at_s, took_s, holds):
    shown = goal("of its own", at_s=99.0, shown_s=at_s)
    trace = GoalLife(second=Put(exchange(201), {}, shown, exchange(), "", ended=False))
    trace = replace(trace, now_s=None if at_s is None else 100.0, took_s=took_s)
    assert [one.holds for one in rules.goal_fills_in.outcomes(trace, _RUN.__getitem__)] == holds


@pytest.mark.parametrize(("status", "holds"), [(204, True), (409, True), (423, False)])
def test_a_linear_velocity_is_driven_or_refused_while_a_goal_is_active(status, holds):
    trace = GoalLife(linear=exchange(status))
    assert [one.holds for one in rules.velocity_goal.outcomes(trace, _RUN.__getitem__)] == [holds]


@pytest.mark.parametrize(
    ("kind", "status", "differs", "ended", "holds"),
    [
        ("goal-put", 202, "", False, True),
        ("goal-put", 200, "", False, False),
        ("goal-conflict", 409, "", False, True),
        ("goal-conflict", 204, "", False, False),
        ("goal-get", 200, "position.x 1 for 2", False, False),
        ("goal-delete", 204, "", False, True),
        ("goal-delete", 204, "status 200", False, False),
        ("goal-delete", 404, "", False, False),
        ("goal-delete", 404, "", True, True),
        ("goal-delete-none-success", 404, "", False, True),
    ],
)
def test_a_step_of_a_walk_is_judged_by_the_rule_of_its_kind(kind, status, differs, ended, holds):
    trace = (GoalStep(kind, exchange(status), differs, ended),)
    assert _holds(getattr(rules, f"{kind.replace('-', '_')}_in_walks"), trace) == [holds]
    assert not _holds(rules.goal_none_in_walks, trace)


def test_a_goal_is_accepted_and_shown_under_its_id_unless_it_has_ended():
    def put(status, differs="", *, ended=False):
        return Put(exchange(status), {"goal_id": {"id": "a"}}, None, exchange(200), differs, ended)

    assert _holds(rules.special_goal_id, (put(201), put(400), put(202, "goal_id.id b for a"))) == [
        True,
        False,
        True,
        True,
        False,
    ]
    assert _holds(rules.special_goal_preempt, (put(201, "status 404", ended=True), put(422), put(201))) == [True]


@pytest.mark.parametrize(
    ("left_m", "off_rad", "reached_rad", "way_m", "holds"),
    [
        (0.25, 0.25, 0.27, 0.5, True),
        (0.29, 0.0, 0.27, 0.5, False),
        (0.1, -0.6, 0.27, 0.5, False),
        (0.1, -0.6, None, 0.5, True),
        (0.1, 0.0, 0.27, 0.1, False),
    ],
)
def test_a_goal_is_reached_within_its_tolerances(left_m, off_rad, reached_rad, way_m, holds):
    trace = GoalReached(
        exchange(201), Pose(1.0, 0.0, 0.0), way_m=way_m, has_to_m=0.15, left_m=left_m, reached_m=0.27, off_rad=off_rad
    )
    trace = replace(trace, reached_rad=reached_rad, read=exchange(404), ended=True)
    assert _holds(rules.goal_drives, trace) == [holds]
    assert _holds(rules.goal_drives, replace(trace, undecided=True)) == []


@pytest.mark.parametrize(("off_rad", "holds"), [(0.2, True), (2.0, False)])
def test_a_goal_where_the_robot_is_turns_it(off_rad, holds):
    trace = GoalReached(exchange(201), Pose(1.0, 0.0, 0.0), way_m=1.0, has_to_m=0.2, reached_m=0.3, reached_rad=0.3)
    trace = replace(trace, read=exchange(404), ended=True, turned_off=(exchange(404), off_rad))
    assert _holds(rules.goal_drives, trace) == [True, holds]


@pytest.mark.parametrize(
    ("last", "fault"),
    [
        (None, "no member last_goal"),
        ({"goal_id": {"id": "a"}}, "last_goal"),
        (_last("b", 4), "last_goal.goal_id.id"),
        (_last("a", 6), "last_goal.status.code 6"),
        (_last("a", 4), ""),
    ],
)
def test_how_a_goal_ended_is_told_with_its_id(last, fault):
    body = json.dumps({"status": 404, "detail": "none", "last_goal": last}).encode()
    found = outcome_fault(exchange(404, body), SUCCEEDED, "a")
    assert found.startswith(fault)
    assert bool(found) == bool(fault)


@pytest.mark.parametrize(("found", "holds"), [("", [True]), ("an active goal", [False]), ("0.1 m/s", [])])
def test_a_refused_request_sets_no_goal(found, holds):
    trace = RefusedAgain(rests=(Case(not found, exchange(), "rest after requests", found),))
    assert _holds(refused.goal_refused_again, trace) == holds


@pytest.mark.parametrize("differs", ["", "none"])
def test_a_refused_request_changes_no_goal(differs):
    put = exchange(400, method="PUT")
    goal = replace(put, request=replace(put.request, url=f"http://robot{GOAL_PATH}"))
    trace = RefusedAgain(during=(DuringGoal("an empty id", goal, differs), DuringGoal("another path", put, differs)))
    for rule in (refused.goal_refused_again, refused.goal_kept):
        (case,) = rule.outcomes(trace, {}.__getitem__)
        assert case.holds is not bool(differs)
        assert case.expected.startswith("the goal that was active before PUT with an")


@pytest.mark.parametrize(("left_m", "drives_judged"), [(0.1, [True]), (9.0, [])])
def test_another_clients_goal_after_the_own_one_is_no_fault(left_m, drives_judged):
    trace = GoalReached(
        exchange(202), Pose(1.0, 0.0, 0.0), way_m=1.0, has_to_m=0.2, left_m=left_m, reached_m=0.3, read=exchange(200)
    )
    trace = replace(trace, other=True, undecided=not trace.is_near)
    assert _holds(rules.goal_drives, trace) == drives_judged
    assert _holds(rules.goal_ended, trace) == _holds(rules.goal_outcome_when_reached, trace) == []
