"""Adjustments to a request before parsing, and checks of its complete head."""

import re
from typing import Final

from reference_robot.webservices.http.messages import BODY_LIMIT, Field
from reference_robot.webservices.representation.problems import Problem, not_yet

TARGET_LIMIT: Final = 8000  # bytes (RFC 9110 4.1 requires at least that)
HEAD_LIMIT: Final = 64 * 1024  # bytes: request line and fields (RFC 6585 5)

# Fields that may occur only once in a request (RFC 9110 5.3; 9112 3.2 for Host).
_SINGLE: Final = frozenset({b"host", b"content-type", b"content-length", b"authorization"})

_SERVED: Final = (b"GET ", b"PUT ", b"POST ", b"DELETE ", b"HEAD ", b"OPTIONS ")
_UPGRADE: Final = re.compile(rb"(?i)(?<=\r\n)Upgrade(?=:)")
_METHOD: Final = re.compile(rb"[!#$%&'*+.^_`|~0-9A-Za-z-]++(?= [^ \r\n]+ HTTP/1\.[01]\r?\n)")


def readable(data: bytes) -> bytes:
    """Return the first bytes of a request, changed so that the HTTP parser accepts them.

    A method that no resource offers is replaced by TRACE. The parser would reject unknown methods; so they get the same
    405 or 404 as any unsupported method (RFC 9110 15.5.6).

    The Upgrade field is renamed, because the parser would read the body as data of another protocol. The robot supports
    no upgrades and may ignore the field (RFC 9110 7.8). Java's HttpClient requests h2c with every first request.
    """
    if not data.startswith(_SERVED):
        method = _METHOD.match(data)
        data = data if method is None else b"TRACE" + data[method.end() :]
    if b"pgrade:" not in data:
        return data
    head, end, rest = data.partition(b"\r\n\r\n")
    return _UPGRADE.sub(b"X-Ignored-Upgrade", head) + end + rest


def fields_by_name(fields: list[Field]) -> dict[bytes, bytes]:
    """Return field values by lower-case name, with repeated fields joined by a comma.

    Raises:
        Problem: 400 for a repeated field that may occur only once.
    """
    headers: dict[bytes, bytes] = {}
    for name, value in fields:
        if name not in headers:
            headers[name] = value
        elif name in _SINGLE:
            raise Problem(400, f"the field {name.decode('latin-1')} occurs more than once (RFC 9110 5.3)")
        else:
            headers[name] += b", " + value
    return headers


def head_too_large() -> Problem:
    """Return the Problem 431 for a head that is too long (RFC 6585 5)."""
    return Problem(431, f"the head of the request exceeds {HEAD_LIMIT} bytes")


def require_old_version(version: str) -> None:
    """Raise the Problem 400 for a missing Host field, unless the version is HTTP/1.0, which has no Host field."""
    if version != "1.0":
        raise Problem(400, "the request has no Host field (RFC 9112 3.2)")


def require_bounded(size: int) -> None:
    """Raise the Problem 413 if the body's size exceeds the limit (RFC 9110 15.5.14)."""
    if size > BODY_LIMIT:
        raise Problem(413, f"the body of {size} bytes exceeds the limit of {BODY_LIMIT} bytes")


def no_request(error: BaseException) -> Problem:
    """Return the Problem 400 for bytes that the parser rejects (RFC 9112 2.2)."""
    return Problem(400, f"the request is not valid HTTP: {error}")


def full() -> Problem:
    """Return the Problem 503 for a request that would exceed the memory kept for clients (RFC 9110 15.6.4)."""
    return not_yet("the memory for requests of clients is full")
