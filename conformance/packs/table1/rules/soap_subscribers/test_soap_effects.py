"""Rules on effects of SOAP messages and REST requests: in the list of deliveries, and in the active goal."""

from collections.abc import Iterator

from conformance.packs.table1.scenarios.soap_effects import GOAL_ID, Misunderstood, goal_by_soap, misunderstood
from conformance.scenarios.rule import Case, Note, Outcome, rule
from conformance.transport.exchange import Exchange


@rule("soap-basic-profile/R1025", on=(misunderstood,))
def misunderstood_has_no_effect(trace: Misunderstood) -> Iterator[Outcome]:
    """Judge that a delivery that gets a MustUnderstand fault does not appear in the list of deliveries."""
    if not trace.lists:
        # That the robot answers nothing but the fault is judged elsewhere.
        yield Note("the robot lists no deliveries, so what it does could not be seen")
    if any(listed is None for _, listed in trace.answers):
        yield Note("what the robot does could not be seen: it lists no valid delivery")
    yield from _no_effect(trace)


@rule("soap-basic-profile/R1028", on=(misunderstood,))
def fault_ends_processing(trace: Misunderstood) -> Iterator[Outcome]:
    """Judge that the robot does not carry out a delivery after it has generated a fault."""
    return _no_effect(trace)


@rule("soap-subscribers/goal", on=(goal_by_soap,))
def goal_is_shown(trace: tuple[tuple[Exchange, str | None], ...]) -> Iterator[Outcome]:
    """Judge that GetGoal shows the active goal."""
    for exchange, shown in trace:
        expected = f"the active goal, with goal_id.id {GOAL_ID!r}"
        yield Case(shown == GOAL_ID, exchange, expected, f"goal_id.id {shown!r}")


def _no_effect(trace: Misunderstood) -> Iterator[Case]:
    for exchange, listed in trace.answers:
        if listed is not None:
            expected = "no effect of a request that is answered MustUnderstand"
            yield Case(not listed, exchange, expected, "the delivery in the robot's list")
