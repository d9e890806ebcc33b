"""Rules on effects of SOAP messages and REST requests: in the list of deliveries, and in the active goal."""

from collections.abc import Iterator

from conformance.api.soap.calls import read_exchange
from conformance.packs.table1.robot.soap_services import text_at
from conformance.packs.table1.scenarios.soap_effects import (
    GOAL_ID,
    GoalBySoap,
    Misunderstood,
    goal_by_soap,
    misunderstood,
)
from conformance.scenarios.rule import Note, Outcome, rule
from conformance.verdict.evidence import Case

_LAST = ("detail", "last_goal")
# The goal has succeeded, or was cancelled.
_ENDED = frozenset({"4", "5"})


@rule("soap-basic-profile/R1025", on=(misunderstood,))
def misunderstood_has_no_effect(trace: Misunderstood) -> Iterator[Outcome]:
    """Judge that a delivery that gets a MustUnderstand fault does not appear in the list of deliveries."""
    if not trace.lists:
        # Another check judges a robot that responds only with faults.
        yield Note("the robot lists no deliveries, so what it does could not be seen")
    if any(listed is None for _, listed in trace.answers):
        yield Note("what the robot does could not be seen: it lists no valid delivery")
    yield from _no_effect(trace)


@rule("soap-basic-profile/R1028", on=(misunderstood,))
def fault_ends_processing(trace: Misunderstood) -> Iterator[Outcome]:
    """Judge that the robot does not carry out a delivery after it has generated a fault."""
    return _no_effect(trace)


@rule("soap-subscribers/goal", on=(goal_by_soap,))
def goal_is_shown(trace: GoalBySoap) -> Iterator[Outcome]:
    """Judge that GetGoal shows the active goal."""
    if trace.shown is not None:
        exchange, shown = trace.shown
        expected = f"the active goal, with goal_id.id {GOAL_ID!r}"
        yield Case(shown == GOAL_ID, exchange, expected, f"goal_id.id {shown!r}")


@rule("soap-subscribers/goal-outcome", on=(goal_by_soap,))
def outcome_is_told(trace: GoalBySoap) -> Iterator[Outcome]:
    """Judge that GetGoal's fault after a goal names the ended goal, and how it ended."""
    fault = None if trace.after is None else read_exchange(trace.after).fault
    if fault is not None:
        id_ = text_at(fault.element, *_LAST, "goal_id", "id")
        code = text_at(fault.element, *_LAST, "status", "code")
        expected = f"a detail with last_goal: goal_id.id {GOAL_ID!r}, and status.code 4 or 5"
        yield Case(id_ == GOAL_ID and code in _ENDED, trace.after, expected, f"id {id_!r} and code {code!r}")


def _no_effect(trace: Misunderstood) -> Iterator[Case]:
    for exchange, listed in trace.answers:
        if listed is not None:
            expected = "no effect of a request that is answered MustUnderstand"
            yield Case(not listed, exchange, expected, "the delivery in the robot's list")
