"""Decide by a response's status whether a request was refused, accepted or cut off, and what it would have needed."""

import re
from collections.abc import Callable, Collection
from http import HTTPStatus
from typing import Final
from urllib.parse import unquote

from conformance.contract.classes import LIMIT_OCTETS
from conformance.documents.files import keeps_octets
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import Operation
from conformance.documents.representation import flat
from conformance.transport.exchange import BUSY, Attempt, Exchange, NoAnswer, Unanswered

#: Statuses which say that the server, or one behind it, failed. 503 only says "not now", and 501 "never".
CRASHES = frozenset({500, 502, 504})
#: Statuses that HTTP lets any server or gateway send, so that no description need have them: conditions, ranges, rates,
#: sizes, upgrades.
ANY_TIME: Final = frozenset({100, 101, 206, 304, 401, 407, 408, 411, 412, 413, 414, 416, 417, 421, 425, 426, 429, 431})
#: Statuses which say that the device's state forbids the operation, whatever the request contains: conflict, condition,
#: lock, rate limit, no room (RFC 9110 15.5.10, 15.5.13; RFC 4918 11.3, 11.5; RFC 6585 3, 4).
HELD: Final = frozenset({409, 412, 423, 428, 429, 503, 507})
# Digits, with the hexadecimal letters around them: times and request ids, which differ between responses to the same
# request.
_VARYING: Final = re.compile(r"[0-9a-fA-F]*\d[0-9a-fA-F]*")
# Operations that one sentence names; the table of operations names all.
_NAMED = 4
# How often a request is sent to learn its usual status, because a server error may be rare.
_TRIES = 3
#: Statuses that refuse a request because of its sender, or because another client holds a lock (RFC 9110 15.5, RFC 4918
#: 11.3, RFC 6585 3).
REFUSALS: Final = frozenset({401, 403, 407, 423, 428})
# Statuses that refuse a request for a reason outside its content.
_NO_REFUSALS = frozenset({401, 405, 406, 408, 429})
# What an operation needs for its first 2xx response, in words.
_VALUES: Final = "values that the device knows"
_CREDENTIALS: Final = "credentials that may do this"
_OF_STATUS: Final = {
    400: _VALUES,
    401: _CREDENTIALS,
    403: _CREDENTIALS,
    404: _VALUES,
    407: _CREDENTIALS,
    409: "another state of the device",
    410: _VALUES,
    412: "a condition that holds, such as the present ETag in If-Match",
    415: _VALUES,
    422: _VALUES,
    423: "a lock or lease that another client may hold",
    428: "a condition, such as the present ETag in If-Match",
    429: "a device that is less busy",
    503: "a device that is less busy",
    507: "room on the device",
}


def held_text(labels: Collection[str], statuses: Collection[int]) -> str:
    """Return in words that the device's state did not allow some operations."""
    named, more = list(labels)[:_NAMED], len(labels) - _NAMED
    whose, were = ("its", "was") if len(labels) == 1 else ("their", "were")
    others = f" and {more} more operation{'s' if more > 1 else ''}" if more > 0 else ""
    only = " or ".join(map(str, sorted(statuses)))
    return f"{', '.join(named)}{others} {were} answered only {only}: {whose} state did not allow it"


def is_refusal(exchange: Exchange) -> bool:
    """Return whether a request was refused because of its content."""
    status = exchange.response.status
    return HTTPStatus.BAD_REQUEST <= status < HTTPStatus.INTERNAL_SERVER_ERROR and status not in _NO_REFUSALS


def refuses(status: int, operation: Operation | None) -> bool:
    """Return whether a status says that a request was not performed.

    A proxy may have sent 408 after the device has acted. Many servers find out that no format is acceptable when they
    have acted; an operation that declares 406 refuses by it.
    """
    is_declared = operation is not None and str(status) in operation.responses
    unclear = {HTTPStatus.REQUEST_TIMEOUT} if is_declared else {HTTPStatus.NOT_ACCEPTABLE, HTTPStatus.REQUEST_TIMEOUT}
    return HTTPStatus.BAD_REQUEST <= status < HTTPStatus.INTERNAL_SERVER_ERROR and status not in unclear


def is_taken(exchange: Exchange) -> bool:
    """Return whether a valid request was accepted, or only put off: a goal of the robot's own may be active."""
    return exchange.response.ok or exchange.response.status == HTTPStatus.CONFLICT


def usual_status(send: Callable[[], Exchange]) -> int:
    """Return the status of a request that others are compared with: neither a server error nor a 429 now and then."""
    for _ in range(_TRIES):
        status = send().response.status
        if status < HTTPStatus.INTERNAL_SERVER_ERROR and status not in BUSY:
            break
    return status


def is_cut_off(attempt: Attempt) -> bool:
    """Return whether the robot closed the connection on content over the limit (contract.md, sizes).

    A gateway in front of it then responds 502 in its place (RFC 9110 15.6.3). Smaller content has to be answered: a
    closed connection cannot be told from a crash.
    """
    if len(attempt.request.body) <= LIMIT_OCTETS:
        return False
    if isinstance(attempt, Unanswered):
        return attempt.kind is NoAnswer.CLOSED
    return attempt.response.status == HTTPStatus.BAD_GATEWAY


def need_of(operation: Operation, status: int) -> tuple[str, list[str]]:
    """Return what an operation needs to succeed, as a noun phrase, and the names of the values that may help.

    Args:
        operation: it never answered 2xx.
        status: the status of its usual request.
    """
    need = _OF_STATUS.get(status, "")
    in_path = [item.name for item in operation.parameter("path")]
    if need != _VALUES:
        # Another thing of the same kind may be in a state that allows the operation.
        return need, in_path if status in HELD else []
    files = [name for name in operation.bodies if keeps_octets(name)]
    if files and len(files) == len(operation.bodies) and status not in {404, 410}:
        return f"a file of {files[0]} that it takes, which the suite cannot make", []
    required = [item.name for item in operation.parameters if item.required and item.where != "path"]
    members = [name for body in operation.bodies.values() for name in _members(body.schema)]
    names = in_path if in_path and status in {404, 410} else [*in_path, *required, *members]
    names = list(dict.fromkeys(names))
    return (f"{need}: {', '.join(names)}" if names else ""), names


def _members(schema: Schema) -> list[str]:
    """Return the members of an object that are required."""
    whole = flat(schema)
    required = whole.get("required", ())
    return [name for name in whole.get("properties", {}) if name in required]


def differ(one: Exchange, other: Exchange) -> bool:
    """Return whether two responses differ in more than numbers and values repeated from their requests."""
    return _without_request(one) != _without_request(other)


def _without_request(exchange: Exchange) -> tuple[int, str, str]:
    answer, target = exchange.response, exchange.request.target
    text = unquote(answer.body.decode("utf-8", "replace"))
    for part in (target, *target.split("?", 1), exchange.request.method):
        text = text.replace(unquote(part), "")
    return answer.status, answer.media_type, _VARYING.sub("", text)
