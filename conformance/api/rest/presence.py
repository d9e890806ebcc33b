"""Whether an operation that a description names is there."""

from http import HTTPStatus
from typing import Final

from conformance.api.rest.applicable import allowed
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface

_NOT_IMPLEMENTED: Final = frozenset({HTTPStatus.METHOD_NOT_ALLOWED, HTTPStatus.NOT_IMPLEMENTED})


def judge_there(api: RestInterface, requirement: str, call: Call, *, known: bool = True) -> None:
    """Judge by the request itself where it may be sent and needs nothing, else by what OPTIONS says of its path.

    Args:
        api: the robot's REST interface.
        requirement: id of what asks for it.
        call: a request for the operation.
        known: whether the contract has the operation. A resource of the robot's own need not know OPTIONS, nor have
            what a made-up value in its path would name: then nothing is said of it.
    """
    operation = call.operation
    asked = operation.safe and allowed(api, operation)
    exchange = call.send(api) if asked else Call(operation, call.values).send(api, method="OPTIONS")
    status = exchange.response.status
    if asked and status == HTTPStatus.NOT_FOUND and operation.declared(status) is not None:
        # The resource may well be there with nothing in it: its methods tell.
        exchange = call.send(api, method="OPTIONS")
        status = exchange.response.status
        asked = False
    allow = exchange.response.header("allow")
    named = allow is None or operation.method in {name.strip() for name in allow.split(",")}
    if asked:
        there = status not in {HTTPStatus.NOT_FOUND, *_NOT_IMPLEMENTED}
    elif status in _NOT_IMPLEMENTED and allow is None and not known:
        return
    else:
        refused = status in _NOT_IMPLEMENTED and (known or allow is None)
        there = status != HTTPStatus.NOT_FOUND and named and not refused
    if status == HTTPStatus.NOT_FOUND and "{" in operation.template and not known:
        return
    api.run.judge.check(
        requirement,
        there,
        exchange,
        f"{operation.label} to be there",
        found="Allow does not name it" if not (asked or named) else f"status {status}",
        cause=operation.label,
    )
