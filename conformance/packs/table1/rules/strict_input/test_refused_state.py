"""Rules on requests that the robot must reject: they must change neither the velocity nor the goal."""

from collections.abc import Iterator
from typing import Final

from conformance.packs.table1.robot.standstill_trace import Rest, Standing, stays
from conformance.packs.table1.scenarios.invalid_goals import InvalidGoal, invalid_goals
from conformance.packs.table1.scenarios.invalid_velocities import invalid_velocities
from conformance.packs.table1.scenarios.standing import standing
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.case import Case

_VELOCITY: Final = "strict-input/velocity-refused"


@rule(_VELOCITY, on=(invalid_velocities,))
def velocity_refused(trace: tuple[Rest, ...]) -> Iterator[Outcome]:
    """Judge that the robot is at rest after each invalid velocity."""
    return (rest.case for rest in trace)


@rule(_VELOCITY, on=(standing,))
def velocity_refused_later(trace: tuple[Standing, ...]) -> Iterator[Outcome]:
    """Judge that the robot stays at rest after all invalid velocities."""
    return stays(trace, _VELOCITY)


@rule("strict-input/goal-refused", on=(invalid_goals,))
def goal_refused(trace: tuple[InvalidGoal, ...]) -> Iterator[Outcome]:
    """Judge that the robot follows no invalid goal, and keeps the goal that it has."""
    for one in trace:
        kept = "the goal that was active before" if one.during else "no goal after"
        expected = f"{kept} {one.exchange.request.method} with {one.what}"
        yield Case(not one.differs, one.exchange, expected, one.differs, cause=one.what)
