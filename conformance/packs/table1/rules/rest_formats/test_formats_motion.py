"""Rules on one state in several formats: in motion, at rest elsewhere, for several goals and for several plans."""

from collections.abc import Iterator

from conformance.documents.representation import UnreadableError, by_itself
from conformance.packs.table1.scenarios.formats import (
    FormatsRead,
    formats_in_motion,
    formats_of_goals,
    formats_of_plans,
    goal_as_text,
)
from conformance.scenarios.rule import NotClaimed, Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case


@rule("rest-formats/same-values", on=(formats_in_motion, formats_of_goals, formats_of_plans))
def same_values(trace: tuple[FormatsRead, ...]) -> Iterator[Outcome]:
    """Judge that all formats of a resource have the same values."""
    for read in trace:
        if read.put:
            continue
        expected = f"the same values in all formats of {read.template}"
        yield Case(not read.differs, read.exchange, expected, read.differs, cause=read.operation)


@rule("rest-formats/xml-input", on=(formats_of_goals,))
def xml_input(trace: tuple[FormatsRead, ...]) -> Iterator[Outcome]:
    """Judge that a goal in XML is the goal that the robot then has."""
    for read in trace:
        if read.put:
            yield Case(not read.differs, read.exchange, "the goal that was sent", read.differs, cause="putGoal effect")


@rule("rest-formats/text-quoted", on=(goal_as_text,))
def text_quoted(trace: tuple[tuple[str, Exchange], ...]) -> Iterator[Outcome]:
    """Judge that text shows an id that looks like a number or another type as a string."""
    if not trace:
        yield NotClaimed("the goal is not described as plain text")
    for id_, exchange in trace:
        try:
            shown = by_itself(exchange.response.body)
        except UnreadableError:
            shown = None  # judged where all formats are compared
        goal_id = shown.get("goal_id") if isinstance(shown, dict) else None
        found = goal_id.get("id", id_) if isinstance(goal_id, dict) else id_
        expected = f"the id {id_} in quotation marks, as ros2 topic echo prints it"
        yield Case(isinstance(found, str), exchange, expected, f"{found!r}, which is no string", cause="no string")
