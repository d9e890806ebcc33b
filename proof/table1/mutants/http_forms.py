"""Mutants that reject a valid form of a request, such as chunked content, or accept an invalid one."""

import re
import threading
from collections.abc import Callable

from proof.mutation.changes import plain, problem, rest, rewritten
from proof.mutation.messages import Change, Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import deliveries

MUTANTS = Table()
_mutant = MUTANTS.of_class("http", "rest")

_HEAD = rest("HEAD")
_CUT = 1024
_MUCH = 4096
_MOST = 100


def _having(test: Callable[[Request], bool]) -> Callable[[Request], bool]:
    """Return a condition for well-formed REST requests that fulfil ``test``."""
    return lambda request: request.side == "rest" and request.raw is None and test(request)


def _body_like(pattern: bytes) -> Callable[[Request], bool]:
    """Return a condition for PUT requests whose body matches the pattern."""
    compiled = re.compile(pattern)
    return _having(lambda request: request.method == "PUT" and bool(compiled.search(request.body)))


def _upper(name: str) -> Callable[[Request], bool]:
    """Return a condition for requests whose header ``name`` has a value with capital letters."""
    return _having(lambda request: (request.field(name) or "").lower() != (request.field(name) or ""))


def _came(pattern: bytes) -> Callable[[Request], bool]:
    """Return a condition for requests whose bytes, as received, match the pattern."""
    compiled = re.compile(pattern)
    return _having(lambda request: bool(compiled.search(b"".join(request.came))))


def _forgetting(where: Callable[[Request], bool], *names: str) -> Callable[[], Change]:
    """Return a change that removes headers from requests."""

    def forget(request: Request) -> None:
        for name in names:
            request.drop(name)

    return rewritten(where, forget)


def _first_line(request: Request) -> None:
    if first := request.field("Accept"):
        request.put("Accept", first)


def _last_line(request: Request) -> None:
    lines = [value for name, value in request.fields if name.lower() == "accept"]
    if lines:
        request.put("Accept", lines[-1])


def _conditional(name: str) -> Callable[[Request], bool]:
    """Return a condition for GET requests with the header ``name``."""
    return _having(lambda request: request.method == "GET" and request.field(name) is not None)


_chunked = _having(lambda request: request.field("Transfer-Encoding") is not None)
_absolute = _having(lambda request: not request.target.startswith("/"))


def _shorten(request: Request) -> None:
    request.body = request.body[:_CUT]


@_mutant("http-hundred-requests", "many-requests", "After 100 requests on a connection, the robot returns 400.")
class _Hundred:
    def __init__(self) -> None:
        self._connection = threading.local()

    def __call__(self, request: Request, forward: Forward) -> Response:
        self._connection.requests = getattr(self._connection, "requests", 0) + 1
        if request.side == "rest" and self._connection.requests > _MOST:
            return problem(400, "enough of you")(request)
        return forward(request)


@_mutant("http-stays-open", "web-server/close", "The robot ignores Connection: close.")
def _keep_open(request: Request, forward: Forward) -> Response:
    if request.side == "rest":
        request.drop("Connection")
    return forward(request)


def _in_chunks(response: Response) -> None:
    """Write the response as one chunk, even for an HTTP/1.0 client."""
    head = f"HTTP/1.1 {response.status} OK\r\nContent-Type: {response.media_type}\r\nTransfer-Encoding: chunked\r\n\r\n"
    response.raw = head.encode() + b"%x\r\n%b\r\n0\r\n\r\n" % (len(response.body), response.body)


def _and_rubbish(response: Response) -> None:
    """Answer the bytes that follow, read from the wrong place, as an invalid request."""
    response.raw = response.octets() + b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n"


_HOST = re.compile(rb"(?i)\r\nHost:[ \t]*([^\r\n]+)")


def _mend(pattern: bytes) -> Callable[[Request], Request | None]:
    """Return a function that makes a plain GET of a malformed request, or returns None for other requests."""
    compiled = re.compile(pattern)

    def mend(request: Request) -> Request | None:
        if request.side != "rest" or request.raw is None or not compiled.search(request.raw):
            return None
        line = request.raw.split(b"\r\n", 1)[0].decode("latin-1").split(" ")
        # A robot may answer only to its own host names.
        host = _HOST.search(request.raw)
        return Request("rest", "GET", line[1], fields=[("Host", host[1].decode("latin-1") if host else "robot")])

    return mend


def _acting(pattern: bytes) -> Callable[[], Change]:
    """Return a change that reads the hidden part of malformed requests as a Content-Length, and so loses its place."""

    def change(request: Request, forward: Forward) -> Response:
        mended = _mend(pattern)(request)
        response = forward(mended or request)
        if mended is not None:
            _and_rubbish(response)
        return response

    return lambda: change


def _ignoring(pattern: bytes) -> Callable[[], Change]:
    """Return a change that ignores the malformed part of requests."""
    return lambda: lambda request, forward: forward(_mend(pattern)(request) or request)


def _without_length(request: Request) -> None:
    request.drop("Content-Length")


_both = _came(rb"(?is)(?=.*\r\nTransfer-Encoding:)(?=.*\r\nContent-Length:)")


@_mutant(
    "http-length-before-chunks",
    "web-server/length-and-chunks",
    "Content-Length ends a request that also has Transfer-Encoding.",
)
def _length_first(request: Request, forward: Forward) -> Response:
    if not _both(request):
        return forward(request)
    request.drop("Content-Length")
    response = forward(request)
    _and_rubbish(response)
    return response


_mutant("http-one-segment", "octet-stream", "A request head in several TCP segments returns 400.").instead(
    _having(lambda request: b"\r\n\r\n" not in request.came[0]), problem(400, "no end of the head")
)
_mutant(
    "http-first-line", "web-server/field-lines", "Of several Accept headers, the robot uses only the first."
).rewritten(_having(lambda request: request.field("Accept") is not None), _first_line)
_mutant(
    "http-last-line", "web-server/field-lines", "Of several Accept headers, the robot uses only the last."
).rewritten(_having(lambda request: request.field("Accept") is not None), _last_line)
_mutant("http-no-charset-in-accept", "accept-parameters", "A charset parameter in Accept returns 406.").instead(
    _having(lambda request: "charset" in (request.field("Accept") or "").lower()), problem(406, "not that")
)
_mutant("http-old-client-chunks", "web-server/old-client", "A client of HTTP/1.0 gets a chunked response.").altered(
    _having(lambda request: request.version == "HTTP/1.0"), _in_chunks
)
_mutant(
    "http-head-of-what-cannot-be-read", "method-not-allowed", "HEAD of a delivery returns 200, though GET returns 405."
).instead(_having(lambda request: _HEAD(request) and deliveries(request.copy(method="PUT"))), plain(200))
_mutant("http-short-targets", "web-server/target-length", "A request target over 4 KiB returns 414.").instead(
    _having(lambda request: len(request.target) > _MUCH), problem(414, "too long")
)
