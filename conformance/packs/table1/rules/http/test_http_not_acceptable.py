"""Rules on PUTs whose Accept header excludes all formats (contract, several clients)."""

from collections.abc import Iterator

from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, VELOCITY
from conformance.packs.table1.scenarios.not_acceptable import NotAcceptable, not_acceptable
from conformance.packs.table1.scenarios.standing import later
from conformance.scenarios.rule import Note, Outcome, rule
from conformance.verdict.evidence import Case

Puts = tuple[NotAcceptable, ...]


@rule("http/not-acceptable-undone", on=(not_acceptable,))
def not_acceptable_undone(trace: Puts) -> Iterator[Outcome]:
    """Judge that the robot is at rest after a PUT that it answered 406.

    Motion may be the effect of an earlier attempt: it is judged when each attempt has been repeated alone.
    """
    rests = [one.rest for one in trace if one.rest is not None]
    if not rests:
        yield Note("no PUT of a velocity or a goal is answered 406")
    yield from (rest for rest in rests if rest.holds)


not_acceptable_undone_later = later("http/not-acceptable-undone")


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
    for one in trace:
        if one.path == path and one.has_effect is not None:
            expected = f"the robot to apply a PUT of {path} to which it responds {one.exchange.response.status}"
            observed = "no effect, though the same PUT with Accept: application/json has one"
            yield Case(one.has_effect, one.exchange, expected, observed)
