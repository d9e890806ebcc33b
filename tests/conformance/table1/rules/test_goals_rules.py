"""Rules on goals that have to be refused, by traces made by hand."""

import pytest
from toy_messages import exchange

from conformance.packs.table1.robot.goal_trace import FarGoal, RefusedGoals, SpecialGoal
from conformance.packs.table1.rules.rest_resources import test_goal_refused as rules


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
        (202, 200, False, "a goal that is active 10 s later"),
    ],
)
def test_a_goal_outside_every_map_is_refused_or_ends(status, read, holds, observed):
    far = FarGoal(exchange(status), None if read is None else exchange(read), 10.0)
    (case,) = rules.goal_unreachable.outcomes(RefusedGoals(far=(far,)), {}.__getitem__)
    assert (case.holds, case.observed) == (holds, observed)
