"""Find out whether an operation that a description declares exists on the device."""

from dataclasses import replace
from http import HTTPStatus
from typing import Final

from conformance.api.expectation import expect
from conformance.api.rest.applicable import allows
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.parameters import wrong_texts
from conformance.transport.exchange import Exchange

# A media type that no operation takes.
_NOT_TAKEN: Final = "image/png"
_NOT_IMPLEMENTED: Final = frozenset({HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED})


def judge_there(api: RestInterface, requirement: str, call: Call, *, known: bool = True) -> None:
    """Judge whether an operation exists: by its own request, or by OPTIONS on its path.

    The operation's own request is sent where it may be sent and moves nothing; else OPTIONS, which proves something by
    Allow, by 2xx and by 404. Where OPTIONS leaves it open, an operation of the contract gets a request that it has to
    refuse, if the run may move the robot.

    Args:
        api: the robot's REST interface.
        requirement: id of the requirement.
        call: a request for the operation.
        known: whether the contract has the operation. A resource of the robot's own may lack what a made-up value in
            its path names.
    """
    operation = call.operation
    exchange, there = None, None
    if operation.safe and allows(api, operation):
        exchange = call.send(api)
        there = _by_itself(call, exchange)
    if there is None:
        exchange = call.bare.send(api, method="OPTIONS")
        there = _by_options(call, exchange)
        is_open = there is None or exchange.response.status == HTTPStatus.NOT_FOUND
        refused = _to_be_refused(call)
        if is_open and known and refused is not None and allows(api, operation):
            exchange = refused.send(api)
            there = _by_itself(call, exchange)
    status = exchange.response.status if exchange is not None else 0
    if there is None or (status == HTTPStatus.NOT_FOUND and "{" in operation.template and not known):
        api.run.judge.note(requirement, f"not judged for {operation.label}: no request that may be sent shows it")
        return
    found = "" if there or exchange is None else _absence(exchange)
    expected = f"an operation {operation.label}, which the description declares"
    expect(api.run.judge, requirement, exchange).that(there, expected, found, cause=operation.label)


def _to_be_refused(call: Call) -> Call | None:
    """Return a request that reaches an operation and that it must refuse; None if no such request can be made."""
    operation = call.operation
    if operation.safe:
        return None
    if operation.bodies:
        return replace(call, inputs=replace(call.inputs, media_type=_NOT_TAKEN, body=b"roaas"))
    wrong = [item for parameter in operation.parameter("path") for item in wrong_texts(parameter) if item.text]
    return call.having(wrong[0].name, wrong[0].text) if wrong else None


def _by_itself(call: Call, exchange: Exchange) -> bool | None:
    """Return whether a response shows that the operation exists; None if the resource may just be empty."""
    status = exchange.response.status
    may_be_empty = call.operation.schemas_for(status) is not None or (
        not call.operation.safe and "{" in call.operation.template
    )
    if status == HTTPStatus.NOT_FOUND and may_be_empty:
        return None
    return status != HTTPStatus.NOT_FOUND and status not in _NOT_IMPLEMENTED


def _by_options(call: Call, exchange: Exchange) -> bool | None:
    """Return whether the response to OPTIONS shows that an operation exists; None if it leaves that open."""
    allow, status = exchange.response.header("allow"), exchange.response.status
    if status == HTTPStatus.NOT_FOUND:
        return False
    if allow is not None:
        return call.operation.method in {name.strip() for name in allow.split(",")}
    # If a resource refuses OPTIONS without `Allow`, its other methods remain unknown.
    return None if status in _NOT_IMPLEMENTED else True


def _absence(exchange: Exchange) -> str:
    """Return the evidence in a response that the operation does not exist, as text."""
    allow, status = exchange.response.header("allow"), exchange.response.status
    named = f" with Allow: {allow}" if allow is not None else ""
    return f"status {status}{named} for {exchange.request.method}"
