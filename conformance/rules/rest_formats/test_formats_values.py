"""JSON, XML and plain text of the same moment: each must be readable and have the same values (contract, formats)."""

import time
from collections.abc import Callable
from functools import partial

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads, working_reads
from conformance.api.rest.calls import Call, root_name
from conformance.api.rest.formats import at_once, each_after, judge_same_values
from conformance.api.rest.interface import RestInterface
from conformance.documents.json_schema import kind_of
from conformance.documents.openapi import Operation, is_xml, operations_of
from conformance.documents.representation import UnreadableError, local_name, parse_xml
from conformance.scenarios.scenario import NoOccasionError
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
_XML = "application/xml"
_TEXT = "text/plain"
# No robot has its responses in this format.
_NO_FORMAT = "image/png"
# Pause longer than a client's between two requests, s.
_PAUSE_S = 1.1
_IDS = {_XML: "rest-formats/xml", _TEXT: "rest-formats/text"}


def _say_lacking(api: RestInterface, media_type: str, *ids: str) -> None:
    """Mark requirements as not applicable where no operation of the contract has the format."""
    if not any(media_type in operation.formats for operation in operations_of(api.run.contract)):
        for id_ in ids:
            api.run.judge.note_unclaimed(id_, f"the contract has no responses as {media_type}")


@pytest.mark.phase("settling")
@pytest.mark.requirement(
    "rest-formats/xml", "rest-formats/xml-root", "rest-formats/text", "rest-formats/charset", "rest-formats/vary"
)
def test_each_format_is_sent(api: RestInterface, judge: Judge, effort: Effort) -> None:
    """GET each resource as XML and as text; the checkers judge the responses."""
    _say_lacking(api, _XML, "rest-formats/xml", "rest-formats/xml-root")
    _say_lacking(api, _TEXT, "rest-formats/text")
    if not any({_XML, _TEXT} & set(operation.formats) for operation in operations_of(api.run.contract)):
        judge.note_unclaimed("rest-formats/charset", "the contract has responses neither as XML nor as plain text")
    if not any(len(operation.formats) > 1 for operation in operations_of(api.run.contract)):
        judge.note_unclaimed("rest-formats/vary", "the contract has no responses in more than one format")
    calls = working_reads(api)
    if not calls:
        raise NoOccasionError("no operation that only reads was answered 2xx")
    for turn in range(effort.cases(12) if effort.name != "quick" else 1):
        for call in calls[turn % len(calls) :] + calls[: turn % len(calls)]:
            for media_type, id_ in _IDS.items():
                if media_type not in call.operation.formats:
                    continue
                exchange = call.send(api, ("Accept", media_type))
                answer = exchange.response
                sent = expect(judge, id_, exchange).that(
                    answer.ok and answer.media_type == media_type,
                    f"status 200 with {media_type} when Accept is {media_type}",
                    cause=f"{call.operation.id} {exchange.came}",
                )
                if sent and is_xml(media_type):
                    fault = _root_fault(call.operation, answer.body)
                    expected = "a root element with the name of the type"
                    expect(judge, "rest-formats/xml-root", exchange).that(not fault, expected, fault)


def _root_fault(operation: Operation, body: bytes) -> str:
    """Return what is wrong with the root element's name; a list's root may have any name."""
    schema = operation.shape or {}
    wanted = root_name(schema)
    if not wanted or kind_of(schema) == "array":
        return ""
    try:
        found = local_name(parse_xml(body))
    except UnreadableError as error:
        return str(error)
    return "" if found == wanted else f"the root element {found!r} where the type is {wanted!r}"


@pytest.mark.phase("resting")
@pytest.mark.requirement("rest-formats/same-values")
def test_formats_carry_the_same_values(api: RestInterface, judge: Judge) -> None:
    """Compare every value of each resource in all its formats."""
    compared = 0
    for call in api.run.effort.subsample(reads(api), 5):
        others = [name for name in _IDS if name in call.operation.formats]
        if not others:
            continue
        compared += judge_same_values(api, call, others).response.ok
    if not compared and not any(set(_IDS) & set(item.formats) for item in operations_of(api.run.contract)):
        judge.note_unclaimed("rest-formats/same-values", "the contract has one format only")


@pytest.mark.phase("resting")
@pytest.mark.requirement("rest-formats/same-values")
def test_formats_carry_the_same_values_after_other_requests(api: RestInterface) -> None:
    """Compare every value again: just after a refused request or one that acts, on a new connection, after a pause.

    And by several clients at once. At quick, the seed says after what.
    """
    run = api.run

    def send_unacceptable(call: Call) -> object:
        return call.send(api, ("Accept", _NO_FORMAT))

    events: list[Callable[[Call], object]] = [send_unacceptable, lambda _: api.client.close()]
    if run.allow_motion:
        events.append(lambda _: api.device.halt(api))
    calls = [call for call in run.effort.subsample(reads(api), 5) if len(call.operation.formats) > 1]
    for event in run.effort.draw(events, 3, f"{run.seed}/events"):
        for call in calls:
            judge_same_values(api, call, list(call.operation.formats), reader=each_after(partial(event, call)))
    for call in reads(api):
        try:
            judge_same_values(api, call, list(call.operation.formats), reader=at_once)
        except NoAnswerError:
            break  # whether several clients are served has a requirement of its own
    # A pause costs its time: only in longer runs, and the seed says for which resource.
    for call in run.effort.draw(calls, 1, f"{run.seed}/pause") if run.effort.name != "quick" else ():
        formats = run.effort.draw(call.operation.formats, 1, f"{run.seed}/formats")
        judge_same_values(api, call, formats, reader=each_after(partial(time.sleep, _PAUSE_S)))


@pytest.mark.phase("aside")
@pytest.mark.requirement("rest-formats/same-values")
def test_formats_of_lists(api: RestInterface) -> None:
    """Compare every value of each list once more: it may have been empty, or have held equal entries, before."""
    for call in reads(api):
        others = [name for name in _IDS if name in call.operation.formats]
        if others and kind_of(call.operation.shape or {}) == "array":
            judge_same_values(api, call, others)
