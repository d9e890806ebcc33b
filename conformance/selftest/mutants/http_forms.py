"""Robots that take a request in one form and not in another that says the same."""

import re
import threading
from collections.abc import Callable

from conformance.selftest.messages import Forward, Request, Response
from conformance.selftest.mutants.changes import altered, anything, header, instead, problem, rest, rewritten
from conformance.selftest.mutants.mutant import of_class

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


MUTANTS = (
    _mutant("http-hundred-requests", "On one connection a hundred requests are answered.", "many-requests", _Hundred),
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
