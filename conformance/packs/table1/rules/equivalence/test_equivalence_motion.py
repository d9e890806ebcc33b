"""Rules on pose, velocity and goal over REST and SOAP, while the robot moves and when it has come to rest."""

from collections.abc import Iterator

from conformance.packs.table1.robot.state_over_soap import StateRead
from conformance.packs.table1.scenarios.goals_over_soap import GoalRead, goals_over_soap
from conformance.packs.table1.scenarios.interfaces_in_motion import interfaces_in_motion
from conformance.scenarios.rule import Outcome, rule


@rule("equivalence/pose", on=(interfaces_in_motion,))
def pose(trace: tuple[StateRead, ...]) -> Iterator[Outcome]:
    """Judge that both interfaces show the same pose."""
    return (case for one in trace if one.name == "pose" for case in one.cases)


@rule("equivalence/velocity", on=(interfaces_in_motion,))
def velocity(trace: tuple[StateRead, ...]) -> Iterator[Outcome]:
    """Judge that both interfaces show the same velocity."""
    return (case for one in trace if one.name == "velocity" for case in one.cases)


@rule("equivalence/goal", on=(goals_over_soap,))
def goal(trace: tuple[GoalRead, ...]) -> Iterator[Outcome]:
    """Judge that both interfaces show the same goal, or none."""
    return (case for one in trace for case in one.cases)
