"""Robots that take a request in one form and not in another that says the same, or one that nobody has."""

import re
import threading
from collections.abc import Callable

from conformance.mutation.changes import altered, anything, becomes, header, instead, plain, problem, rest, rewritten
from conformance.mutation.messages import Change, Forward, Request, Response, unchanged
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import deliveries

_HEAD = rest("HEAD")
_CUT = 1024
_MUCH = 4096
_MOST = 100


def _having(test: Callable[[Request], bool]) -> Callable[[Request], bool]:
    """REST requests of which something is so."""
    return lambda request: request.side == "rest" and request.raw is None and test(request)


def _written(pattern: bytes) -> Callable[[Request], bool]:
    """PUTs of JSON in whose text something stands."""
    compiled = re.compile(pattern)
    return _having(lambda request: request.method == "PUT" and bool(compiled.search(request.body)))


def _upper(name: str) -> Callable[[Request], bool]:
    """Requests with a field that has capital letters."""
    return _having(lambda request: (request.field(name) or "").lower() != (request.field(name) or ""))


def _came(pattern: bytes) -> Callable[[Request], bool]:
    """Requests in whose octets, as they came, something stands."""
    compiled = re.compile(pattern)
    return _having(lambda request: bool(compiled.search(b"".join(request.came))))


def _forgetting(where: Callable[[Request], bool], *names: str) -> Callable[[], Change]:
    """Requests without some of their fields."""

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
    """GET with a field that asks for less than all."""
    return _having(lambda request: request.method == "GET" and request.field(name) is not None)


_chunked = _having(lambda request: request.field("Transfer-Encoding") is not None)
_absolute = _having(lambda request: not request.target.startswith("/"))
_mutant = of_class("http", "rest")


def _shortened(request: Request) -> None:
    request.body = request.body[:_CUT]


class _Hundred:
    """What comes after a hundred requests on one connection, which has a thread of its own, is 400."""

    def __init__(self) -> None:
        self._connection = threading.local()

    def __call__(self, request: Request, forward: Forward) -> Response:
        """See messages.Change."""
        self._connection.requests = getattr(self._connection, "requests", 0) + 1
        if request.side == "rest" and self._connection.requests > _MOST:
            return problem(400, "enough of you")(request)
        return forward(request)


def _kept(request: Request, forward: Forward) -> Response:
    """Nobody, the proxy neither, sees that the client asks for the end of the connection."""
    if request.side == "rest":
        request.drop("Connection")
    return forward(request)


def _in_chunks(response: Response) -> None:
    """An answer in one chunk, whoever asked."""
    head = f"HTTP/1.1 {response.status} OK\r\nContent-Type: {response.media_type}\r\nTransfer-Encoding: chunked\r\n\r\n"
    response.raw = head.encode() + b"%x\r\n%b\r\n0\r\n\r\n" % (len(response.body), response.body)


MUTANTS = (
    _mutant(
        "http-no-chunk-extensions",
        "A chunk with an extension is 400.",
        "chunk-forms",
        instead(_came(rb"\r\n[0-9a-f]+;[^\r]*\r\n"), problem(400, "no chunk size")),
    ),
    _mutant(
        "http-no-trailers",
        "Trailer fields are 400.",
        "chunk-forms",
        instead(_came(rb"\r\n0\r\n[^\r]"), problem(400, "no end of the chunks")),
    ),
    _mutant(
        "http-expectation-failed",
        "Expect: 100-continue is 417.",
        "expect-continue",
        instead(_came(rb"(?i)\r\nexpect: *100"), problem(417, "no")),
    ),
    _mutant(
        "http-one-segment",
        "A head that does not come in one piece is 400.",
        "octet-stream",
        instead(_having(lambda request: b"\r\n\r\n" not in request.came[0]), problem(400, "no end of the head")),
    ),
    _mutant(
        "http-names-in-lower-case",
        "A field whose name is not written as usual is not seen.",
        "field-forms",
        _forgetting(_came(rb"\r\n(?:accept|ACCEPT|aCCept):"), "Accept"),
    ),
    _mutant(
        "http-one-blank",
        "A field without one blank behind its colon is not seen.",
        "field-forms",
        _forgetting(_came(rb"\r\n[aA][cC]+ept:(?! [^ ])"), "Accept"),
    ),
    _mutant(
        "http-first-line",
        "Of several Accept lines the first one counts.",
        "field-lines",
        rewritten(_having(lambda request: request.field("Accept") is not None), _first_line),
    ),
    _mutant(
        "http-last-line",
        "Of several Accept lines the last one counts.",
        "field-lines",
        rewritten(_having(lambda request: request.field("Accept") is not None), _last_line),
    ),
    _mutant(
        "http-never-modified",
        "Whoever has any entity tag is told 304.",
        "preconditions",
        instead(_conditional("If-None-Match"), plain(304)),
    ),
    _mutant(
        "http-never-modified-since",
        "Whoever has any date is told 304.",
        "preconditions",
        instead(_conditional("If-Modified-Since"), plain(304)),
    ),
    _mutant("http-part-of-all", "A part is 206 with all of it.", "range", altered(_conditional("Range"), becomes(206))),
    _mutant(
        "http-no-charset-in-accept",
        "A format with a charset in Accept is 406.",
        "accept-parameters",
        instead(
            _having(lambda request: "charset" in (request.field("Accept") or "").lower()), problem(406, "not that")
        ),
    ),
    _mutant("http-stays-open", "Connection: close is not heeded.", "close", lambda: _kept),
    _mutant(
        "http-old-client-chunks",
        "A client of HTTP/1.0 is answered in chunks.",
        "old-client",
        altered(_having(lambda request: request.version == "HTTP/1.0"), _in_chunks),
    ),
    _mutant("http-hundred-requests", "On one connection a hundred requests are answered.", "many-requests", _Hundred),
    _mutant(
        "http-pipelining-forgotten",
        "Of requests that were sent at once, the first alone is answered, and the connection stays open.",
        "pipelining",
        lambda: unchanged,
        forgetful=True,
    ),
    _mutant(
        "http-head-of-what-cannot-be-read",
        "HEAD of a delivery is answered 200, though GET is 405.",
        "method-not-allowed",
        instead(_having(lambda request: _HEAD(request) and deliveries(request.copy(method="PUT"))), plain(200)),
    ),
    _mutant(
        "http-no-chunks", "Chunked content is 411.", "chunked", instead(_chunked, problem(411, "a length, please"))
    ),
    _mutant("http-few-chunks", "Of chunked content, 1 KiB is read.", "chunked", rewritten(_chunked, _shortened)),
    _mutant(
        "http-no-absolute", "A target in absolute form is 400.", "absolute-form", instead(_absolute, problem(400, ""))
    ),
    _mutant(
        "http-absolute-unknown",
        "A target in absolute form is 404.",
        "absolute-form",
        instead(_absolute, problem(404, "")),
    ),
    _mutant(
        "http-type-case",
        "A media type with a capital letter is 415.",
        "media-type-case",
        instead(_upper("Content-Type"), problem(415, "application/json, please")),
    ),
    _mutant(
        "http-accept-case",
        "A media type with a capital letter is not acceptable.",
        "media-type-case",
        instead(_upper("Accept"), problem(406, "application/json is what there is")),
    ),
    _mutant(
        "http-short-targets",
        "A target over 4 KiB is 414.",
        "target-length",
        instead(_having(lambda request: len(request.target) > _MUCH), problem(414, "too long")),
    ),
    _mutant(
        "http-head-empty", "HEAD says Content-Length: 0.", "head-length", altered(_HEAD, header("Content-Length", "0"))
    ),
    _mutant(
        "http-head-length-of-error",
        "HEAD says a Content-Length of its own.",
        "head-length",
        altered(_HEAD, header("Content-Length", "31"), anything),
    ),
    _mutant(
        "json-no-exponents",
        "A number in JSON with an exponent is 422.",
        "json-numbers",
        instead(_written(rb"\d[eE][+-]?\d"), problem(422, "a number, please")),
    ),
    _mutant(
        "json-no-negative-zero",
        "A zero with a sign is 422.",
        "json-numbers",
        instead(_written(rb"-0(?![.\d])"), problem(422, "a number, please")),
    ),
    _mutant(
        "json-small-integers",
        "Integers of ten digits are 422.",
        "json-integers",
        instead(_written(rb"[:\s]-?214748364[78]\b"), problem(422, "sec: too large")),
    ),
)
