"""Mutants with faulty HTTP framing, problem details or JSON, and mutants that accept malformed requests."""

import json
import re
from collections.abc import Callable
from typing import Any

from proof.mutation.changes import JSON, Make, Where, altered, instead, parsed, plain, problem, rest, values
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import POSE, RESOURCES

MUTANTS = Table()
_mutant = MUTANTS.of_class("http", "rest")

_ANY, _GET, _POSE = rest(), rest("GET"), rest("GET", POSE)
_INPUT = rest("PUT", *RESOURCES)
_SESAME = "open-sesame"
_TRACE = (
    'Traceback (most recent call last):\n  File "/opt/robot/server.py", line 118, in handle\n'
    '    x = float(body["linear"]["x"])\nKeyError: \'linear\''
)


def _errors(response: Response) -> bool:
    return response.status >= 400


def _problems(edit: Callable[[Any], Any], where: Where = _ANY) -> Make:
    """Return a change that applies ``edit`` to problem details."""
    return altered(
        where, values(edit), lambda response: _errors(response) and response.media_type.endswith("problem+json")
    )


def _valueless(value: Any) -> None:
    kept = re.sub(
        r"'[^']*'|\"[^\"]*\"|[-+]?\b\d[\d.eE+-]*|\bNaN\b|-?Infinity|null|None|true|false|True|False|[{\[].*",
        "",
        value["detail"],
    )
    value["detail"] = kept


def _on_the_wire(edit: Callable[[bytes], bytes]) -> Callable[[Response], None]:
    """Return an edit of the bytes of a response."""
    return lambda response: setattr(response, "raw", edit(response.octets()))


def _longer(octets: bytes) -> bytes:
    return re.sub(rb"(?i)(content-length: )(\d+)", lambda found: found[1] + str(int(found[2]) + 7).encode(), octets)


def _with_field(request: Request, name: str, value: str) -> Request:
    """Return a malformed request in which one header ``name`` replaces all headers of that name."""
    head, _, body = (request.raw or b"").partition(b"\r\n\r\n")
    line, *fields = head.split(b"\r\n")
    others = [field for field in fields if not field.lower().startswith(f"{name.lower()}:".encode())]
    return request.copy(raw=b"\r\n".join([line, f"{name}: {value}".encode(), *others, b"", b""]) + body)


def _count(request: Request, name: str) -> int | None:
    """Return how many headers ``name`` a malformed REST request has; None for other requests."""
    if request.side != "rest" or request.raw is None:
        return None
    return len(re.findall(rb"(?i)\r\n%s:" % name.encode(), request.raw))


def _hosts(taken: Callable[[list[bytes]], bool]) -> Callable[[Request, Forward], Response]:
    """Return a change that accepts malformed requests whose list of Host values fulfils ``taken``."""

    def change(request: Request, forward: Forward) -> Response:
        if request.side != "rest" or request.raw is None:
            return forward(request)
        hosts = re.findall(rb"(?i)\r\nHost:[ \t]*([^\r\n]*)", request.raw)
        return forward(_with_field(request, "Host", "robot") if taken(hosts) else request)

    return change


@_mutant(
    "http-first-length",
    "web-server/content-length-conflict",
    "Of two Content-Length headers, the robot uses the first.",
)
def _first_length(request: Request, forward: Forward) -> Response:
    if (_count(request, "Content-Length") or 0) > 1:
        _, _, body = (request.raw or b"").partition(b"\r\n\r\n")
        request = _with_field(request, "Content-Length", str(len(body)))
    return forward(request)


@_mutant("http-garbage-fine", "web-server/malformed-request", "Bytes that are not HTTP get a response with status 200.")
def _garbage(request: Request, forward: Forward) -> Response:
    if request.side == "rest" and request.raw is not None:
        return plain(200, b"<html>hello</html>", "text/html", ("Date", "Thu, 01 Jan 2026 00:00:00 GMT"))(request)
    return forward(request)


def _long_target(request: Request) -> bool:
    return _ANY(request) and len(request.target) > 8000


def _big(size: int, response: Callable[[Request], Response]) -> Callable[[], Any]:
    return instead(lambda request: request.side == "rest" and len(request.body) > size, response)


def _in_latin(response: Response) -> None:
    value = parsed(response.body)
    if isinstance(value, dict) and "child_frame_id" in value:
        value["child_frame_id"] = "base_l\u00efnk"
        response.body = json.dumps(value, ensure_ascii=False).encode("latin-1")


_unauthorized = problem(401, "no token", ("WWW-Authenticate", "Bearer"))


def _token(refused: Callable[[Request], Response], where: Where = _ANY, *, acts: bool = False) -> Callable[[], Any]:
    """Return a change that requires a bearer token, and lets ``refused`` answer requests without it.

    Args:
        refused: the response to requests without the token.
        where: the requests that require it.
        acts: whether a request without it is carried out all the same.
    """

    def change(request: Request, forward: Forward) -> Response:
        if where(request) and request.raw is None and request.field("Authorization") != f"Bearer {_SESAME}":
            if acts:
                forward(request)
            return refused(request)
        return forward(request)

    return lambda: change


def _add_bom(response: Response) -> None:
    if response.media_type == JSON:
        response.body = b"\xef\xbb\xbf" + response.body


def _page(response: Response) -> None:
    response.body = f"<html><body>Error {response.status}</body></html>".encode()
    response.put("Content-Type", "text/html")


_mutant("http-large-field-crash", "web-server/header-too-large", "A header of 128 KiB returns 500.").instead(
    lambda request: _ANY(request) and any(len(value) > 60_000 for _, value in request.fields), problem(500, "oops")
)
_mutant("http-length-too-short", "framing", "The body is longer than Content-Length.").altered(
    _GET, _on_the_wire(lambda octets: octets + b"left over")
)
_mutant("http-broken-field", "framing", "A response contains a line that is not a header.").altered(
    _POSE, _on_the_wire(lambda octets: octets.replace(b"\r\n", b"\r\nThis is no field\r\n", 1))
)
_mutant("http-two-lengths", "framing", "A response has two different Content-Length headers.").altered(
    _POSE, _on_the_wire(lambda octets: octets.replace(b"\r\n\r\n", b"\r\nContent-Length: 3\r\n\r\n", 1))
)
_mutant("http-host-optional", "web-server/host-missing", "The robot accepts a request without Host.")(
    _hosts(lambda hosts: not hosts)
)
_mutant("http-host-twice", "web-server/host-twice", "The robot accepts a request with two Host headers.")(
    _hosts(lambda hosts: len(hosts) > 1)
)
_mutant(
    "http-host-repeated", "web-server/host-repeated", "The robot accepts a request with the same Host header twice."
)(_hosts(lambda hosts: len(hosts) > 1 and len(set(hosts)) == 1))
_mutant("http-problem-other-status", "problem-status", "The status member of problem details is wrong.").made(
    _problems(lambda value: value.update(status=400 if value["status"] != 400 else 422))
)
_mutant("http-traceback", "no-traceback", "The detail of problem details contains a traceback.").made(
    _problems(lambda value: value.update(detail=value["detail"] + "\n" + _TRACE), _INPUT)
)
