"""Rules on simultaneous PUTs of several clients: the robot must end up with one client's whole value."""

from collections.abc import Iterator

from conformance.packs.table1.robot.concurrent_puts import ConcurrentGoal, ConcurrentVelocities, GoalRead
from conformance.packs.table1.robot.drive_rules import ECHO
from conformance.packs.table1.robot.drive_trace import Command
from conformance.packs.table1.robot.goal import NEW, REPEATED
from conformance.packs.table1.robot.message_shapes import TWIST, read_as
from conformance.packs.table1.robot.robot import Velocity
from conformance.packs.table1.scenarios.concurrent_puts import concurrent_goal, concurrent_goals, concurrent_velocities
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Note, Outcome, rule
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run


@rule("rest-resources/goal-concurrent", on=(concurrent_goal,))
def goal_concurrent(trace: tuple[ConcurrentGoal, ...]) -> Iterator[Outcome]:
    """Judge that several clients' PUTs of one new goal make one goal, which one DELETE cancels."""
    for one in trace:
        statuses = sorted(put.response.status for put in one.puts)
        yield Case(
            statuses.count(201) <= 1 and not NEW.isdisjoint(statuses) and set(statuses) <= NEW | REPEATED,
            next((put for put in one.puts if put.response.status not in NEW | REPEATED), one.puts[0]),
            "one 201 or 202, and 200, 202 or 204 for the others that put the same new goal at that moment",
            f"the statuses {', '.join(map(str, statuses))}",
        )
        if one.read is not None:
            yield Case(not one.read.differs, one.read.exchange, "the goal that all clients put", one.read.differs)
        for read in one.cancelled:
            yield Case(bool(read.differs), read.exchange, "one goal, gone once it is cancelled", "the goal once more")


@rule("rest-resources/concurrent-puts", on=(concurrent_goals,))
def one_goal_is_active(trace: tuple[GoalRead, ...]) -> Iterator[Outcome]:
    """Judge that of several clients' goals one is active, with id and pose of the same client."""
    for one in trace:
        yield Case(not one.differs, one.exchange, "the goal of one client, with its id and its pose", one.differs)


@rule("rest-resources/concurrent-puts", on=(concurrent_velocities,))
def one_velocity_is_reached(trace: tuple[ConcurrentVelocities, ...], run: Run) -> Iterator[Outcome]:
    """Judge that the robot reaches one client's velocity in all components."""
    limits = said_of(run).limits
    for one in trace:
        for accepted in one.accepted:
            yield from _echoed(accepted)
        expected = f"the velocity of one client: {' or '.join(f'({each.velocity})' for each in one.accepted)}"
        reached, missed = one.reached(limits), one.missed(limits)
        if reached is not None:
            yield Case(True, reached.velocity_exchange, expected)
        elif missed is not None:
            yield Case(False, missed.velocity_exchange, expected, f"the velocity ({missed.velocity})")
        elif one.last and not one.is_decided(limits):
            yield Note("a velocity that several clients put ended before it was seen to be reached")


def _echoed(accepted: Command) -> Iterator[Case]:
    """Yield whether the velocity in the response, if any, is the one that was sent."""
    twist, problem = read_as(accepted.exchange.response, TWIST)
    if not problem:
        echo = Velocity.of(twist)
        same = all(abs(one - other) <= ECHO for one, other in zip(echo, accepted.velocity, strict=True))
        yield Case(same, accepted.exchange, f"the accepted velocity, {accepted.velocity}", f"{echo}")
