"""Rules on goals that a robot must reject, and on two that it must accept."""

from collections.abc import Iterator

from conformance.packs.table1.robot.goal import NEW
from conformance.packs.table1.robot.goal_trace import RefusedGoals, SpecialGoal
from conformance.packs.table1.scenarios.refused_goals import refused_goals
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.evidence import Case


def _refused(put: SpecialGoal) -> Case:
    holds = 400 <= put.exchange.response.status < 500
    return Case(holds, put.exchange, f"4xx for a goal with {put.special}", cause=put.exchange.came)


@rule("rest-resources/goal-quaternion", on=(refused_goals,))
def goal_quaternion(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals with a quaternion of another length than 1 are refused."""
    return map(_refused, trace.not_unit)


@rule("rest-resources/goal-quaternion-taken", on=(refused_goals,))
def goal_quaternion_taken(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals with a quaternion of length 1 within the tolerance are accepted."""
    for put in trace.unit:
        holds = put.exchange.response.status in NEW
        yield Case(holds, put.exchange, f"201 or 202 for a goal with {put.special}", cause=put.exchange.came)


@rule("rest-resources/goal-frame", on=(refused_goals,))
def goal_frame(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals in unknown frames are refused."""
    return map(_refused, trace.unknown_frames)


@rule("rest-resources/goal-unreachable", on=(refused_goals,))
def goal_unreachable(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals outside every map are refused, or accepted and then ended."""
    for put in trace.far:
        ended = put.read is not None and put.read.response.status == 404
        yield Case(
            400 <= put.exchange.response.status < 500 or ended,
            put.exchange,
            "422 (another 4xx conforms), or a goal that is accepted and ends",
            put.exchange.came if ended or put.read is None else f"a goal that is active {put.waited_s:g} s later",
        )
