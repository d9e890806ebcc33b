"""Rules on goals with random ids and poses, and on goals that a robot must reject."""

from collections.abc import Iterator

from conformance.documents.json_text import clip
from conformance.packs.table1.robot.goal import NEW
from conformance.packs.table1.robot.goal_trace import GoalRead, Put, RefusedGoals, SpecialGoal
from conformance.packs.table1.scenarios.goal_ids import goal_ids, goal_poses
from conformance.packs.table1.scenarios.refused_goals import refused_goals
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.evidence import Case


@rule("rest-resources/goal-id", on=(goal_ids,))
def goal_id(trace: tuple[Put, ...]) -> Iterator[Outcome]:
    """Judge that the robot accepts a goal with any id, and shows it under this id."""
    for put in trace:
        id_ = put.body["goal_id"]["id"]
        expected = f"201 or 202 for the id {clip(id_)}, which has {len(id_)} characters"
        yield Case(put.exchange.response.status in NEW, put.exchange, expected, cause=put.exchange.came)
    yield from _under_its_id(trace)


@rule("rest-resources/goal-preempt", on=(goal_ids,))
def goal_preempt(trace: tuple[Put, ...]) -> Iterator[Outcome]:
    """Judge that each goal replaces the one before."""
    return _under_its_id(trace)


@rule("rest-resources/goal-get", on=(goal_ids,))
def goal_get(trace: tuple[Put, ...]) -> Iterator[Outcome]:
    """Judge that GET shows each goal under its id."""
    return _under_its_id(trace)


@rule("rest-resources/goal-get", on=(goal_poses,))
def goal_get_pose(trace: tuple[GoalRead, ...]) -> Iterator[Outcome]:
    """Judge that GET returns each goal unchanged, in every reading."""
    return (Case(not read.differs, read.exchange, "the goal that was put", read.differs) for read in trace)


def _under_its_id(trace: tuple[Put, ...]) -> Iterator[Case]:
    """Yield whether the robot showed each goal that it accepted, unless the goal had ended."""
    for put in trace:
        if put.exchange.response.status in NEW and not put.ended:
            cause = "another id" if put.differs.startswith("goal_id") else put.differs
            yield Case(not put.differs, put.read, "the goal that was put last, under its id", put.differs, cause)


def _judge_refusal(put: SpecialGoal) -> Case:
    holds = 400 <= put.exchange.response.status < 500
    return Case(holds, put.exchange, f"4xx for a goal with {put.special}", cause=put.exchange.came)


@rule("rest-resources/goal-quaternion", on=(refused_goals,))
def goal_quaternion(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals with a quaternion of another length than 1 are refused."""
    return map(_judge_refusal, trace.not_unit)


@rule("rest-resources/goal-quaternion-taken", on=(refused_goals,))
def goal_quaternion_taken(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals with a quaternion of length 1 within the tolerance are accepted."""
    for put in trace.unit:
        holds = put.exchange.response.status in NEW
        yield Case(holds, put.exchange, f"201 or 202 for a goal with {put.special}", cause=put.exchange.came)


@rule("rest-resources/goal-frame", on=(refused_goals,))
def goal_frame(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals in unknown frames are refused."""
    return map(_judge_refusal, trace.unknown_frames)


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
