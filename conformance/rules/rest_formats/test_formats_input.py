"""PUT takes XML in the form in which the robot sends it (contract, fine print)."""

import math
from dataclasses import replace
from typing import Any

import pytest
from lxml import etree

from conformance.api.expectation import expect
from conformance.api.rest.applicable import applicable_operations, usable_operations
from conformance.api.rest.calls import JSON, XML, Call, example_call, root_name
from conformance.api.rest.effects import reader_of, settles_at
from conformance.api.rest.formats import judge_same_values
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import is_taken
from conformance.contract.classes import TAKEN_OCTETS
from conformance.documents.representation import UnreadableError, flattened, local_name, parse_xml, read
from conformance.documents.writing import xml_bytes
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("input"), pytest.mark.needs("rest")]
_ID = "rest-formats/xml-input"
# Two writings of one number differ by less than this, whatever tolerance is accepted.
_ECHO = 1e-9


@pytest.mark.requirement("rest-formats/same-values", "rest-formats/xml-root")
def test_formats_of_what_was_put(api: RestInterface, judge: Judge) -> None:
    """PUT a resource that exists only then (a goal), and compare its values in all formats."""
    for operation in usable_operations(api, lambda item: item.method == "PUT" and bool(item.bodies)):
        api.device.halt(api)
        call = example_call(api, operation)
        reader = reader_of(api, call)
        if reader is None or reader.send(api).response.ok or not call.send(api).response.ok:
            continue
        others = [name for name in (XML, "text/plain") if name in reader.operation.formats]
        exchange = judge_same_values(api, reader, others)
        if not exchange.response.ok:
            continue
        form = _sent_form(api, call)
        wanted = root_name(reader.operation.shape or {})
        if form is not None and wanted:
            expected, found = f"the root element {wanted!r}", f"the root element {local_name(form)!r}"
            expect(judge, "rest-formats/xml-root", exchange).that(local_name(form) == wanted, expected, found)
    api.device.halt(api)


@pytest.mark.requirement(_ID, "rest-formats/same-values")
def test_xml_is_taken(api: RestInterface, judge: Judge) -> None:
    """Put a valid value as XML: it is accepted, and has the effect that it has as JSON."""
    for operation in applicable_operations(api, [_ID], lambda item: XML in item.bodies, "takes XML"):
        api.device.bring_to_rest(api)
        call = example_call(api, operation, XML)
        plain = example_call(api, operation).send(api)
        if not is_taken(plain):
            judge.note(_ID, f"not tried on {operation.id}: a valid request for it as JSON got {plain.came}")
            continue
        api.device.bring_to_rest(api)
        call = replace(call, inputs=replace(call.inputs, body=api.device.mark(operation.id, call.value)))
        like = _sent_form(api, call)
        body = xml_bytes(call.value, root_name(operation.bodies[XML].schema) or "root", like)
        echoes: list[dict[str, Any]] = []
        for accept in (JSON, XML):
            call = call.rewritten(api, body)
            exchange = call.send(api, ("Accept", accept))
            status = exchange.response.status
            when = f"the body of {operation.id} is {XML}, as when it is JSON"
            taken = expect(judge, _ID, exchange).accepts(when, cause=f"{operation.id} {status}")
            if taken and exchange.response.ok:
                shown, fault = _echo(call, exchange)
                expected = "the accepted value in the response"
                expect(judge, _ID, exchange).that(not fault, expected, fault, cause=f"{operation.id} echo")
                echoes += [shown] if shown else []
        _judge_echoes(api, call, exchange, echoes)
        if taken:
            end = body.rindex(b"</")
            large = call.rewritten(api, body[:end] + b" " * (TAKEN_OCTETS - len(body)) + body[end:])
            exchange = large.send(api)
            expect(judge, _ID, exchange).accepts(f"the body is 64 KiB of {XML}", cause=f"{operation.id} 64 KiB")
        if taken and status != 409:
            other = settles_at(api, call)
            if other is not None:
                expected = f"the effect that {operation.id} has as JSON"
                expect(judge, _ID, exchange).that(not other, expected, other, cause=f"{operation.id} effect")
    api.device.halt(api)


def _judge_echoes(api: RestInterface, call: Call, exchange: Exchange, echoes: list[dict[str, Any]]) -> None:
    """Judge whether a JSON response and one in another format show the accepted value alike."""
    if not api.device.answers_alike(call.operation.template) or len(echoes) < len((JSON, XML)):
        return
    first, last = echoes
    odd = [place for place in flattened(call.value) if first.get(place) != last.get(place)]
    expect(api.run.judge, "rest-formats/same-values", exchange).that(
        not odd,
        f"the same accepted value in each format of the response to {call.operation.id}",
        f"{last.get(odd[0])!r} as {odd[0]} in {XML} and {first.get(odd[0])!r} in JSON" if odd else "",
        cause=f"{call.operation.id} echo",
    )


def _sent_form(api: RestInterface, call: Call) -> etree._Element | None:
    """Return the resource as the robot sends it in XML; None where it has nothing to send just now."""
    reader = reader_of(api, call)
    if reader is None:
        return None
    answer = reader.send(api, ("Accept", XML)).response
    if not answer.ok or answer.media_type != XML:
        return None
    try:
        return parse_xml(answer.body)
    except UnreadableError:
        return None


def _same(shown: Any, value: Any) -> bool:
    """Return whether two values are equal, numbers nearly so: a robot may normalize a quaternion."""
    if isinstance(shown, float) and isinstance(value, float):
        return math.isclose(shown, value, rel_tol=_ECHO, abs_tol=_ECHO)
    return bool(shown == value)


def _echo(call: Call, exchange: Exchange) -> tuple[dict[str, Any], str]:
    """Return the values in the response that were in the request, by place (maybe none), and where they differ."""
    answer = exchange.response
    schema = (call.operation.schemas_for(answer.status) or {}).get(answer.media_type)
    if schema is None or not answer.body:
        return {}, ""
    try:
        shown = flattened(read(answer.media_type, answer.body, schema))
    except UnreadableError as error:
        return {}, str(error)
    for place, value in flattened(call.value).items():
        if not _same(shown.get(place), value) and not place.endswith("[]"):
            return shown, f"{shown.get(place, 'nothing')!r} as {place} where {value!r} was sent"
    return shown, ""
