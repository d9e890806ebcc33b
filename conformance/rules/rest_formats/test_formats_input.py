"""PUT takes XML in the form that the robot sends (contract, fine print)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from conformance.api.rest.applicable import applicable_operations
from conformance.api.rest.calls import JSON, XML, Call, example_call, root_name
from conformance.api.rest.effects import reader_of, settles_at
from conformance.api.rest.formats import judge_same_values
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import is_taken
from conformance.contract.sizes import TAKEN_OCTETS
from conformance.documents.representation import UnreadableError, flattened, local_name, parse_xml, read
from conformance.documents.writing import xml_bytes
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

if TYPE_CHECKING:
    from lxml import etree

pytestmark = [pytest.mark.phase("input"), pytest.mark.needs("rest")]
_ID = "rest-formats/xml-input"
# Two writings of one number are no farther apart than this, whatever is accepted.
_ECHO = 1e-9
# What a robot makes of a goal may depend on where it is; of a velocity it makes the same each time.


@pytest.mark.requirement("rest-formats/same-values", "rest-formats/xml-root")
def test_formats_of_what_was_put(api: RestInterface, judge: Judge) -> None:
    """A resource that is there only when something was put (a goal) has the same values in all formats as well."""
    for operation in applicable_operations(
        api, (), lambda item: item.method == "PUT" and bool(item.bodies), "puts something"
    ):
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
            judge.check(
                "rest-formats/xml-root",
                local_name(form) == wanted,
                exchange,
                "a root named after the type",
                found=f"the root element is {local_name(form)!r} and not {wanted!r}",
            )
    api.device.halt(api)


@pytest.mark.requirement(_ID, "rest-formats/same-values")
def test_xml_is_taken(api: RestInterface, judge: Judge) -> None:
    """A valid value as XML is accepted, and has the effect that it has as JSON."""
    for operation in applicable_operations(api, [_ID], lambda item: XML in item.bodies, "takes XML"):
        api.device.bring_to_rest(api)
        call = example_call(api, operation, XML)
        plain = example_call(api, operation).send(api)
        if not is_taken(plain):
            judge.note(_ID, f"a valid {operation.id} as JSON is answered {plain.came}, so it was not tried as XML")
            continue
        api.device.bring_to_rest(api)
        call = replace(call, value=api.device.marked(operation.id, call.value))
        like = _sent_form(api, call)
        body = xml_bytes(call.value, root_name(operation.bodies[XML].schema) or "value", like)
        told: list[dict[str, Any]] = []
        for accept in (JSON, XML):
            call = call.rewritten(api, body)
            exchange = call.send(api, ("Accept", accept))
            status = exchange.response.status
            taken = judge.check(
                _ID,
                is_taken(exchange),
                exchange,
                f"{operation.id} as {XML} accepted as it is as JSON",
                cause=f"{operation.id} {status}",
            )
            if taken and exchange.response.ok:
                shown, fault = _echo(call, exchange)
                judge.check(_ID, not fault, exchange, "the accepted value", found=fault, cause=f"{operation.id} echo")
                told += [shown] if shown else []
        _judge_told(api, call, exchange, told)
        if taken:
            end = body.rindex(b"</")
            large = call.rewritten(api, body[:end] + b" " * (TAKEN_OCTETS - len(body)) + body[end:])
            exchange = large.send(api)
            judge.check(_ID, is_taken(exchange), exchange, f"64 KiB of {XML} taken", cause=f"{operation.id} 64 KiB")
        if taken and status != 409:
            other = settles_at(api, call)
            if other is not None:
                judge.check(
                    _ID,
                    not other,
                    exchange,
                    f"the effect that {operation.id} has as JSON",
                    found=other,
                    cause=f"{operation.id} effect",
                )
    api.device.halt(api)


def _judge_told(api: RestInterface, call: Call, exchange: Exchange, told: list[dict[str, Any]]) -> None:
    """Judge that what was told to have been accepted as JSON, and in another format, is the same."""
    if not api.device.answers_alike(call.operation.template) or len(told) < len((JSON, XML)):
        return
    first, last = told
    odd = [place for place in flattened(call.value) if first.get(place) != last.get(place)]
    api.run.judge.check(
        "rest-formats/same-values",
        not odd,
        exchange,
        f"the same accepted value in all formats that {call.operation.id} answers in",
        found=f"{odd[0]} is {last.get(odd[0])!r} in {XML} and {first.get(odd[0])!r} in JSON" if odd else "",
        cause=f"{call.operation.id} echo",
    )


def _sent_form(api: RestInterface, call: Call) -> etree._Element | None:
    """The resource as the robot sends it in XML; None where it has nothing to send just now."""
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
    """Whether a value came back: a number as near as the quaternion that a robot has brought to unit length."""
    if isinstance(shown, float) and isinstance(value, float):
        return math.isclose(shown, value, rel_tol=_ECHO, abs_tol=_ECHO)
    return bool(shown == value)


def _echo(call: Call, exchange: Exchange) -> tuple[dict[str, Any], str]:
    """What comes back of a value that was sent, by place (nothing may), and what of it is another one."""
    answer = exchange.response
    schema = (call.operation.declared(answer.status) or {}).get(answer.media_type)
    if schema is None or not answer.body:
        return {}, ""
    try:
        shown = flattened(read(answer.media_type, answer.body, schema))
    except UnreadableError as error:
        return {}, str(error)
    for place, value in flattened(call.value).items():
        if not _same(shown.get(place), value) and not place.endswith("[]"):
            return shown, f"{place} is {shown.get(place, 'nothing')!r} for {value!r}"
    return shown, ""
