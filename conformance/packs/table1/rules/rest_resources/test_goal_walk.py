"""Rules on random sequences of goal requests: the goal that was sent last must be the active one."""

from collections.abc import Iterator

from conformance.packs.table1.robot.goal_trace import GoalStep
from conformance.packs.table1.scenarios.goal_walk import goal_walk
from conformance.scenarios.rule import Outcome, Rule, rule


def _judged(kind: str) -> Rule:
    """Return a rule that judges one requirement by the steps of its kind."""

    def judge(trace: tuple[GoalStep, ...]) -> Iterator[Outcome]:
        return (step.case for step in trace if step.kind == kind)

    return rule(f"rest-resources/{kind}", on=(goal_walk,))(judge)


goal_put = _judged("goal-put")
goal_get = _judged("goal-get")
goal_none = _judged("goal-none")
goal_repeat = _judged("goal-repeat")
goal_conflict = _judged("goal-conflict")
goal_preempt = _judged("goal-preempt")
goal_delete = _judged("goal-delete")
goal_delete_none_success = _judged("goal-delete-none-success")
