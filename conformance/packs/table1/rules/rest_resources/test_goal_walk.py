"""Rules on random sequences of goal requests: the goal that was sent last must be the active one."""

from collections.abc import Iterator

from conformance.packs.table1.robot.goal_trace import GoalStep
from conformance.packs.table1.scenarios.goal_walk import goal_walk
from conformance.scenarios.rule import Outcome, Rule, rule


def _rule_of_kind(kind: str) -> Rule:
    """Return a rule that judges one requirement by the steps of its kind."""

    def judge(trace: tuple[GoalStep, ...]) -> Iterator[Outcome]:
        return (step.case for step in trace if step.kind == kind)

    return rule(f"rest-resources/{kind}", on=(goal_walk,))(judge)


goal_put = _rule_of_kind("goal-put")
goal_get = _rule_of_kind("goal-get")
goal_none = _rule_of_kind("goal-none")
goal_repeat = _rule_of_kind("goal-repeat")
goal_conflict = _rule_of_kind("goal-conflict")
goal_preempt = _rule_of_kind("goal-preempt")
goal_delete = _rule_of_kind("goal-delete")
goal_delete_none_success = _rule_of_kind("goal-delete-none-success")
