"""Rules on simultaneous PUTs of several clients, and on PUTs whose Accept header excludes all formats."""

from collections.abc import Iterator

from conformance.packs.table1.robot.drive_rules import ECHO
from conformance.packs.table1.robot.goal import NEW, REPEATED
from conformance.packs.table1.robot.goal_trace import ConcurrentGoal, GoalRead
from conformance.packs.table1.robot.message_shapes import TWIST, read_as
from conformance.packs.table1.robot.motion_map import motion_map_of, velocity_of
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, VELOCITY, Velocity
from conformance.packs.table1.scenarios.concurrent_puts import (
    concurrent_deliveries,
    concurrent_goal,
    concurrent_goals,
    concurrent_velocities,
)
from conformance.packs.table1.scenarios.not_acceptable import NotAcceptable, not_acceptable
from conformance.packs.table1.statement import said_of
from conformance.rules.motion.test_motion import one_client
from conformance.scenarios.motion.trace import Command, Drive
from conformance.scenarios.rule import Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run


@rule("rest-resources/goal-concurrent", on=(concurrent_goal,))
def goal_concurrent(trace: tuple[ConcurrentGoal, ...]) -> Iterator[Outcome]:
    """Judge that several clients' PUTs of one new goal make one goal, which one DELETE cancels."""
    for goal in trace:
        statuses = sorted(put.response.status for put in goal.puts)
        yield Case(
            statuses.count(201) <= 1 and not NEW.isdisjoint(statuses) and set(statuses) <= NEW | REPEATED,
            next((put for put in goal.puts if put.response.status not in NEW | REPEATED), goal.puts[0]),
            "one 201 or 202, and 200, 202 or 204 for the others that put the same new goal at that moment",
            f"the statuses {', '.join(map(str, statuses))}",
        )
        if goal.read is not None:
            yield Case(not goal.read.differs, goal.read.exchange, "the goal that all clients put", goal.read.differs)
        for read in goal.cancelled:
            yield Case(bool(read.differs), read.exchange, "one goal, gone once it is cancelled", "the goal once more")


@rule("rest-resources/concurrent-puts", on=(concurrent_goals,))
def one_goal_is_active(trace: tuple[GoalRead, ...]) -> Iterator[Outcome]:
    """Judge that of several clients' goals one is active, with id and pose of the same client."""
    for read in trace:
        yield Case(not read.differs, read.exchange, "the goal of one client, with its id and its pose", read.differs)


@rule("rest-resources/concurrent-puts", on=(concurrent_velocities,))
def one_velocity_is_reached(trace: tuple[Drive, ...], run: Run) -> Iterator[Outcome]:
    """Judge that the robot reaches one client's velocity in all components."""
    yield from (case for drive in trace for accepted in drive.commands for case in _judge_echo(accepted))
    yield from one_client.judge(trace, motion_map_of(said_of(run)))


def _judge_echo(put: Command) -> Iterator[Case]:
    """Yield whether the response's velocity, if it has one, is the sent velocity."""
    twist, problem = read_as(put.exchange.response, TWIST)
    if put.is_ok and not problem:
        echo, velocity = Velocity.of(twist), velocity_of(put.targets)
        same = all(abs(one - other) <= ECHO for one, other in zip(echo, velocity, strict=True))
        yield Case(same, put.exchange, f"the accepted velocity, {velocity}", f"{echo}")


Puts = tuple[NotAcceptable, ...]


@rule("rest-resources/velocity-converges", on=(not_acceptable,))
def accepted_velocity_converges(trace: Puts) -> Iterator[Outcome]:
    """Judge that a velocity has its effect if the robot accepts it in spite of its Accept header."""
    return _has_effect(trace, VELOCITY)


@rule("rest-resources/linear-put", on=(not_acceptable,))
def accepted_linear_velocity_converges(trace: Puts) -> Iterator[Outcome]:
    """Judge that a linear velocity has its effect if the robot accepts it in spite of its Accept header."""
    return _has_effect(trace, LINEAR)


@rule("rest-resources/goal-get", on=(not_acceptable,))
def accepted_goal_is_shown(trace: Puts) -> Iterator[Outcome]:
    """Judge that a goal has its effect if the robot accepts it in spite of its Accept header."""
    return _has_effect(trace, GOAL_PATH)


def _has_effect(trace: Puts, path: str) -> Iterator[Case]:
    for refusal in trace:
        if refusal.path == path and refusal.has_effect is not None:
            expected = f"the robot to apply a PUT of {path} to which it responds {refusal.exchange.response.status}"
            observed = "no effect, though the same PUT with Accept: application/json has one"
            yield Case(refusal.has_effect, refusal.exchange, expected, observed)


@rule("http/concurrent-answers", on=(concurrent_deliveries,))
def concurrent_answers(trace: tuple[tuple[bool, Exchange], ...]) -> Iterator[Outcome]:
    """Judge that the robot accepts the valid deliveries and rejects the others."""
    for valid, exchange in trace:
        expected = f"{'2xx' if valid else '4xx'} for this delivery, while others are answered"
        yield Case(exchange.response.ok == valid, exchange, expected, cause="another's answer")
