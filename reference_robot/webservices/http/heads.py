"""Adjustments to a request before parsing, and checks of its complete head."""

import re
from typing import Final

from reference_robot.webservices.http.messages import BODY_LIMIT, Field
from reference_robot.webservices.representation.problems import Problem, not_yet

TARGET_LIMIT: Final = 8000  # bytes (RFC 9110 4.1 requires at least that)
HEAD_LIMIT: Final = 64 * 1024  # bytes: request line and fields (RFC 6585 5)
FRAMING_LIMIT: Final = 64 * 1024  # bytes of chunk sizes, chunk extensions and trailers, besides those for each byte:
FRAMING_PER_BYTE: Final = 8  # a chunk of one byte takes six
_FIELD_MARKS: Final = 4  # bytes of a field line besides name and value: colon, space and line end
_VERSIONS: Final = frozenset({"1.1", "1.0"})
FRAMING_FIELDS: Final = (b"content-length", b"transfer-encoding")
# Fields that may occur only once in a request (RFC 9110 5.3; 9112 3.2 for Host).
_SINGLE: Final = frozenset({b"host", b"content-type", b"content-length", b"authorization"})
_SERVED: Final = (b"GET ", b"PUT ", b"POST ", b"DELETE ", b"HEAD ", b"OPTIONS ")
_METHOD: Final = re.compile(rb"[!#$%&'*+.^_`|~0-9A-Za-z-]++(?= [^ \r\n]+ HTTP/1\.[01]\r?\n)")


def readable(data: bytes) -> bytes:
    """Return the first bytes of a request, changed so that the HTTP parser accepts them.

    A method that no resource offers is replaced by TRACE. The parser would reject unknown methods; so they get the same
    405 or 404 as any unsupported method (RFC 9110 15.5.6).
    """
    if not data.startswith(_SERVED):
        method = _METHOD.match(data)
        if method is not None:
            return b"TRACE" + data[method.end() :]
    return data


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


def require_head(version: str, fields: list[Field]) -> None:
    """Raise the Problem for a head that is too long, or that leaves in doubt where the request ends.

    Raises:
        Problem: 431 for fields that are too long, 505 for a version other than HTTP/1 (RFC 9110 15.6.6), 400 for a
            transfer coding in HTTP/1.0, and 501 for a transfer coding other than ``chunked`` (RFC 9112 6.1).
    """
    if sum(len(name) + len(value) + _FIELD_MARKS for name, value in fields) > HEAD_LIMIT:
        raise head_too_large()
    if version not in _VERSIONS:
        raise Problem(505, f"HTTP/{version} is not supported, only HTTP/1.1 and HTTP/1.0")
    codings = b",".join(value for name, value in fields if name == b"transfer-encoding")
    if codings and version == "1.0":
        raise Problem(400, "HTTP/1.0 has no Transfer-Encoding (RFC 9112 6.1)")
    if codings and codings.lower() != b"chunked":
        raise Problem(501, f"Transfer-Encoding {codings.decode('latin-1')[:80]!a} is not supported, only chunked")


def framing_too_large() -> Problem:
    """Return the Problem 431 for chunk extensions and trailers that are too long (RFC 6585 5)."""
    return Problem(431, f"chunk sizes, chunk extensions and trailers exceed {FRAMING_LIMIT} bytes")


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
