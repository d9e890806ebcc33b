"""Rules on velocities that the robot must reject."""

from collections.abc import Iterator

from conformance.packs.table1.scenarios.plans import is_refused
from conformance.packs.table1.scenarios.refused_velocities import RefusedVelocities, refused_velocities
from conformance.packs.table1.scenarios.standing import later
from conformance.scenarios.rule import NotClaimed, Note, Outcome, rule
from conformance.verdict.evidence import Case


@rule("safety/limits-refused", on=(refused_velocities,))
def limits_refused(trace: RefusedVelocities) -> Iterator[Outcome]:
    """Judge that a velocity beyond the limits is rejected with 4xx."""
    for velocity, exchange in trace.beyond:
        expected = f"422 (another 4xx conforms) for a velocity beyond the limits, {velocity}"
        yield Case(is_refused(exchange), exchange, expected, cause=exchange.came)


@rule("safety/refused-keeps", on=(refused_velocities,))
def refused_keeps(trace: RefusedVelocities) -> Iterator[Outcome]:
    """Judge that the robot is at rest after each rejected velocity."""
    yield from (*trace.rests, *_settled(trace))


refused_keeps_later = later("safety/refused-keeps")


@rule("safety/limits-hold", on=(refused_velocities,))
def limits_hold(trace: RefusedVelocities) -> Iterator[Outcome]:
    """Judge that a robot without declared limits does not drive at a velocity that no robot reaches."""
    yield from _settled(trace)


@rule("safety/unactuated-refused", on=(refused_velocities,))
def unactuated_refused(trace: RefusedVelocities) -> Iterator[Outcome]:
    """Judge that a velocity in a component that the robot does not actuate is rejected with 4xx."""
    if trace.all_actuated:
        yield NotClaimed("does not apply: by its statement the robot actuates all six components, so each is driven")
    for one in trace.unactuated:
        expected = f"422 (another 4xx conforms) for {one.velocity}, which the robot cannot actuate"
        holds = is_refused(one.exchange) or one.reached
        yield Case(holds, one.exchange, expected, cause=f"{one.path} {one.exchange.came}")
        if one.reached:
            yield Note(f"the robot reaches {one.velocity}, which its statement leaves out")


def _settled(trace: RefusedVelocities) -> tuple[Case, ...]:
    return () if trace.settled is None else (trace.settled,)
