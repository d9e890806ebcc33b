"""One state in several formats: in motion, at rest elsewhere, for several goals and plans; and the odometry's stamp."""

from collections.abc import Iterator

import pytest

from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.documents.representation import UnreadableError, by_itself, read
from conformance.packs.table1.robot.message_shapes import ODOMETRY
from conformance.packs.table1.robot.robot import POSE
from conformance.packs.table1.scenarios.formats import (
    FormatsRead,
    formats_in_motion,
    formats_of_goals,
    formats_of_plans,
    goal_as_text,
)
from conformance.scenarios.rule import NotClaimed, Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case, Judge


@rule("rest-formats/same-values", on=(formats_in_motion, formats_of_goals, formats_of_plans))
def same_values(trace: tuple[FormatsRead, ...]) -> Iterator[Outcome]:
    """Judge that all formats of a resource have the same values."""
    for reading in trace:
        if reading.put:
            continue
        expected = f"the same values in all formats of {reading.template}"
        yield Case(not reading.differs, reading.exchange, expected, reading.differs, cause=reading.operation)


@rule("rest-formats/xml-input", on=(formats_of_goals,))
def xml_input(trace: tuple[FormatsRead, ...]) -> Iterator[Outcome]:
    """Judge that a goal in XML is the goal that the robot then has."""
    for reading in trace:
        if reading.put:
            found = reading.differs
            yield Case(not found, reading.exchange, "the goal that was sent", found, cause="putGoal effect")


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


_FORMATS = ("application/xml", "text/plain")
_TURNS = 3


@pytest.mark.phase("resting")
@pytest.mark.needs("rest")
@pytest.mark.requirement("rest-formats/same-values")
def test_stamps_lie_between(api: RestInterface, judge: Judge) -> None:
    """Read JSON, another format, and JSON again: the stamp in the middle must lie between the other two."""
    pose = next((call for call in reads(api) if call.operation.template == POSE), None)
    for media_type in _FORMATS if pose is not None else ():
        if pose is None or media_type not in pose.operation.formats:
            continue
        found = ""
        # A single time, a clock may be set or a response late.
        for _ in range(_TURNS):
            exchanges = [pose.send(api, ("Accept", name)) for name in (JSON, media_type, JSON)]
            first, other, last = map(_stamp, exchanges)
            if first is None or other is None or last is None or first <= other <= last or last < first:
                found = ""
                break
            found = f"the stamp {_seconds(other)}, between JSON's {_seconds(first)} and {_seconds(last)}"
        judge.check(
            "rest-formats/same-values",
            not found,
            exchanges[1],
            f"a stamp in {media_type} that lies between the stamps of the JSON responses before and after it",
            found=found,
            cause="stamp",
        )


def _seconds(stamp: tuple[float, float]) -> str:
    """Return seconds and nanoseconds as a number of seconds."""
    return f"{stamp[0]:.0f}.{stamp[1]:09.0f} s"


def _stamp(exchange: Exchange) -> tuple[float, float] | None:
    """Return seconds and nanoseconds of an odometry in any format; None where it cannot be read."""
    answer = exchange.response
    if not answer.ok:
        return None
    try:
        stamp = read(answer.media_type, answer.body, ODOMETRY.schema)["header"]["stamp"]
        return float(stamp["sec"]), float(stamp["nanosec"])
    except (UnreadableError, TypeError, KeyError, ValueError):
        return None
