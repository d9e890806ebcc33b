"""Rules on PUTs whose Accept header excludes all formats, and on several deliveries at the same moment."""

from collections.abc import Iterator

from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, VELOCITY
from conformance.packs.table1.scenarios.concurrent_puts import concurrent_deliveries
from conformance.packs.table1.scenarios.not_acceptable import NotAcceptable, not_acceptable
from conformance.scenarios.rule import Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

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
