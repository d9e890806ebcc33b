"""Rules on goals with random ids and poses: the robot must accept each id, and return each goal unchanged."""

from collections.abc import Iterator

from conformance.documents.json_text import shown
from conformance.packs.table1.robot.goal import NEW
from conformance.packs.table1.robot.goal_trace import GoalRead, Put
from conformance.packs.table1.scenarios.goal_ids import goal_ids, goal_poses
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.evidence import Case


@rule("rest-resources/goal-id", on=(goal_ids,))
def goal_id(trace: tuple[Put, ...]) -> Iterator[Outcome]:
    """Judge that the robot accepts a goal with any id, and shows it under this id."""
    for put in trace:
        id_ = put.body["goal_id"]["id"]
        expected = f"201 or 202 for the id {shown(id_)}, which has {len(id_)} characters"
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
