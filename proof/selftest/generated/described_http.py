"""Mutants of HTTP itself before a described device: fields, methods, framing, and servers that fail."""

import json
import re
import threading
import time
from collections.abc import Callable, Iterator

from conformance.documents.openapi import Operation
from proof.mutation.messages import Change, Forward, HangUpError, Request, Response
from proof.selftest.generated.mutant import SUCCESS, Alter, GeneratedMutant, Tally, altering_requests, in_mode
from proof.selftest.generated.places import Exchange

_BAD_REQUEST = 400
_HANGS_S = 30.0  # how long a hanging mutant waits, s: longer than any deadline of a request
_LATER_S = 0.002  # delay that each request adds, s
_LATEST_S = 0.4  # longest delay, s
_TRACEBACK = json.dumps(
    'Traceback (most recent call last):\n  File "/srv/device/app/handlers.py", line 83, in handle\n    '
    "value = table[key]\nKeyError: 'speed'\n"
).encode()


def make_failed(answer: Response) -> None:
    """Make a response the 500 of a server that failed."""
    answer.status, answer.reason, answer.body = 500, "", b"Internal Server Error"
    answer.put("Content-Type", "text/plain")


def hanging_up(exchange: Exchange, mode_name: str) -> Callable[[Tally], Change]:
    """Return a change that closes the connection in place of a successful response, in a mode."""

    def alter(request: Request, answer: Response) -> Response | None:
        return answer if exchange.concerns(request) and answer.status in SUCCESS else None

    return in_mode(mode_name, alter, hangs_up=True)


def hanging(exchange: Exchange) -> Callable[[Tally], Change]:
    """Return a change that does not answer an operation's requests until the client has gone."""

    def make(tally: Tally) -> Change:
        def change(request: Request, forward: Forward) -> Response:
            if not exchange.concerns(request):
                return forward(request)
            tally()
            time.sleep(_HANGS_S)
            raise HangUpError

        return change

    return make


def slower(exchange: Exchange) -> Callable[[Tally], Change]:
    """Return a change that answers an operation later with each request."""

    def make(tally: Tally) -> Change:
        lock, count = threading.Lock(), 0

        def change(request: Request, forward: Forward) -> Response:
            nonlocal count
            if exchange.concerns(request):
                with lock:
                    count += 1
                    later = min(count * _LATER_S, _LATEST_S)
                tally()
                time.sleep(later)
            return forward(request)

        return change

    return make


def showing_insides(exchange: Exchange) -> Callable[[Tally], Change]:
    """Return a change that puts a traceback into the first text of a JSON error."""

    def edit(_request: Request, answer: Response) -> Response | None:
        altered = answer.copy()
        altered.body = re.sub(rb'(:\s*)"[^"\\]*"', lambda found: found[1] + _TRACEBACK, answer.body, count=1)
        bad = answer.status >= _BAD_REQUEST and answer.media_type.endswith("json")
        return altered if bad and altered.body != answer.body else None

    return edit_responses(exchange.concerns, edit)


def edit_responses(where: Callable[[Request], bool], edit: Alter) -> Callable[[Tally], Change]:
    """Return a change that edits responses to some requests; ``edit`` returns None to leave one as it is."""
    return in_mode("", lambda request, answer: edit(request, answer) if where(request) else None)


_METHOD_NOT_ALLOWED = 405
# Difference of a wrong Content-Length, bytes.
_OFF = 7


def of_http(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants of an operation's resource that break HTTP, whatever the description says."""

    def resource(request: Request) -> bool:
        return request.side == "rest" and re.fullmatch(exchange.path, request.path) is not None

    def at(*methods: str) -> Callable[[Request], bool]:
        return lambda request: resource(request) and request.method in methods

    rows: list[tuple[str, str, Callable[[Request], bool], Alter]] = [
        (name, says, exchange.concerns, edit) for name, (says, edit) in _ANSWERS.items()
    ]
    if operation.method == "GET":
        rows += [(name, says, at("HEAD"), edit) for name, (says, edit) in _HEADS.items()]
    rows += [(name, says, resource, _allow(edit)) for name, (says, edit) in _allows(operation.method).items()]
    rows.append(
        ("unknown-taken", "answers a method that nobody knows with 200 (RFC 9110 9.1)", _unknown(resource), _as_success)
    )
    rows.append(("unknown-fails", "answers a method that nobody knows with 500", _unknown(resource), _failing))
    rows.append(("options-fails", "answers OPTIONS with 500", at("OPTIONS"), _failing))
    for name, says, where, edit in rows:
        make = edit_responses(where, edit)
        yield GeneratedMutant.of(name, exchange, "http", f"{exchange.name} {says}.", make)


def _edit_of(change: Callable[[Response], object], when: Callable[[Response], bool]) -> Alter:
    def edit(_request: Request, answer: Response) -> Response | None:
        if not when(answer):
            return None
        altered = answer.copy()
        change(altered)
        return altered

    return edit


def _fine(answer: Response) -> bool:
    return answer.status in SUCCESS and answer.method != "HEAD"


def _with_body(answer: Response) -> bool:
    return _fine(answer) and bool(answer.body)


def _raw(octets: Callable[[bytes, bytes], bytes]) -> Callable[[Response], None]:
    """Return an edit of the octets of a response, by its head without the last empty line and its body."""

    def edit(answer: Response) -> None:
        head, _, body = answer.octets().partition(b"\r\n\r\n")
        answer.raw = octets(head, body)

    return edit


def _length(head: bytes, by: int) -> bytes:
    return re.sub(
        rb"(?i)(content-length: )(\d+)", lambda found: found[1] + str(max(0, int(found[2]) + by)).encode(), head
    )


def _without_length(head: bytes) -> bytes:
    return re.sub(rb"(?i)\r\ncontent-length: \d+", b"", head)


def _as_part(answer: Response) -> None:
    answer.status, answer.reason = 206, ""
    answer.put("Content-Range", "bytes 0-9/99")


def _not_modified(request: Request, answer: Response) -> Response | None:
    conditional = any(name.lower().startswith("if-") for name, _ in request.fields)
    if conditional or not _fine(answer) or request.method != "GET":
        return None
    altered = answer.copy()
    altered.status, altered.reason, altered.body = 304, "", b""
    return altered


def _failing(_request: Request, answer: Response) -> Response | None:
    altered = answer.copy()
    make_failed(altered)
    return altered


# Changes of successful responses by name, each with the clause that it breaks.
_ANSWERS: dict[str, tuple[str, Alter]] = {
    "no-type": (
        "sends no Content-Type (RFC 9110 8.3)",
        _edit_of(lambda answer: answer.drop("Content-Type"), _with_body),
    ),
    "half-type": (
        "sends a malformed Content-Type (RFC 9110 8.3.1)",
        _edit_of(lambda answer: answer.put("Content-Type", answer.media_type.partition("/")[0]), _with_body),
    ),
    "two-types": (
        "sends Content-Type twice (RFC 9110 5.3)",
        _edit_of(lambda answer: answer.fields.append(("Content-Type", "text/plain")), _with_body),
    ),
    "name-twice": (
        "sends an object with a name twice (RFC 8259 4)",
        _edit_of(
            lambda answer: setattr(answer, "body", re.sub(rb'\{("[^"]+"\s*:)', rb"{\1null,\1", answer.body, count=1)),
            lambda answer: _with_body(answer) and answer.media_type.endswith("json") and b'{"' in answer.body,
        ),
    ),
    "no-date": (
        "sends no Date (RFC 9110 6.6.1)",
        _edit_of(lambda answer: answer.drop("Date"), lambda answer: _fine(answer) and answer.field("Date") is not None),
    ),
    "bad-date": (
        "sends a Date that is no IMF-fixdate (RFC 9110 5.6.7)",
        _edit_of(lambda answer: answer.put("Date", "2026-01-31T12:00:00Z"), _fine),
    ),
    "bad-etag": (
        "sends an ETag without quotes (RFC 9110 8.8.3)",
        _edit_of(lambda answer: answer.put("ETag", "abc"), _fine),
    ),
    "bad-modified": (
        "sends a Last-Modified that is no IMF-fixdate (RFC 9110 8.8.2)",
        _edit_of(lambda answer: answer.put("Last-Modified", "yesterday"), _fine),
    ),
    "long-length": (
        "sends a Content-Length that is too great (RFC 9112 6.3)",
        _edit_of(_raw(lambda head, body: _length(head, _OFF) + b"\r\n\r\n" + body), _with_body),
    ),
    "short-length": (
        "sends a Content-Length that is too small (RFC 9112 6.3)",
        _edit_of(
            _raw(lambda head, body: _length(head, -_OFF) + b"\r\n\r\n" + body),
            lambda answer: _with_body(answer) and len(answer.body) > _OFF,
        ),
    ),
    "two-lengths": (
        "sends two Content-Lengths (RFC 9110 8.6)",
        _edit_of(_raw(lambda head, body: head + b"\r\nContent-Length: 3\r\n\r\n" + body), _with_body),
    ),
    "chunked-and-length": (
        "sends Transfer-Encoding and Content-Length (RFC 9112 6.2)",
        _edit_of(
            _raw(
                lambda head, body: (
                    head + b"\r\nTransfer-Encoding: chunked\r\n\r\n%x\r\n" % len(body) + body + b"\r\n0\r\n\r\n"
                )
            ),
            _with_body,
        ),
    ),
    "bad-chunk": (
        "sends chunks with a wrong size (RFC 9112 7.1)",
        _edit_of(
            _raw(
                lambda head, body: (
                    _without_length(head)
                    + b"\r\nTransfer-Encoding: chunked\r\n\r\n%x\r\n" % (len(body) + 4)
                    + body
                    + b"\r\n0\r\n\r\n"
                )
            ),
            _with_body,
        ),
    ),
    "folded-field": (
        "folds a field over two lines (RFC 9112 5.2)",
        _edit_of(_raw(lambda head, body: head + b"\r\nX-Note: one\r\n two\r\n\r\n" + body), _fine),
    ),
    "space-before-colon": (
        "has a space before a colon (RFC 9112 5.1)",
        _edit_of(_raw(lambda head, body: head + b"\r\nX-Note : one\r\n\r\n" + body), _fine),
    ),
    "unasked-part": (
        "answers 206 where no range was asked for (RFC 9110 15.3.7)",
        _edit_of(_as_part, lambda answer: answer.status in SUCCESS and bool(answer.body)),
    ),
    "unasked-304": ("answers 304 without a condition (RFC 9110 15.4.5)", _not_modified),
}


_HEADS: dict[str, tuple[str, Alter]] = {
    "head-body": (
        "sends a body in response to HEAD (RFC 9110 9.3.2)",
        _edit_of(
            lambda answer: setattr(answer, "raw", answer.octets() + b'{"roaas": 1}'),
            lambda answer: answer.status in SUCCESS,
        ),
    ),
    "head-type": (
        "sends another Content-Type for HEAD than for GET (RFC 9110 9.3.2)",
        _edit_of(lambda answer: answer.put("Content-Type", "text/html"), lambda answer: answer.status in SUCCESS),
    ),
    "head-length": (
        "sends another Content-Length for HEAD than for GET (RFC 9110 8.6)",
        _edit_of(lambda answer: answer.put("Content-Length", "1"), lambda answer: answer.status in SUCCESS),
    ),
    "head-fails": ("answers HEAD with 500", _failing),
}


def _as_success(_request: Request, answer: Response) -> Response | None:
    altered = answer.copy()
    altered.status, altered.reason = 200, ""
    return altered


def _unknown(resource: Callable[[Request], bool]) -> Callable[[Request], bool]:
    known = {"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT"}
    return lambda request: (
        resource(request) and bool(re.fullmatch(r"[A-Z]+", request.method)) and request.method not in known
    )


def _allow(edit: Callable[[Response], object]) -> Alter:
    return _edit_of(edit, lambda answer: answer.field("Allow") is not None and answer.status == _METHOD_NOT_ALLOWED)


def _allows(method: str) -> dict[str, tuple[str, Callable[[Response], object]]]:
    def less(answer: Response) -> None:
        words = re.split(r"\s*,\s*", answer.field("Allow") or "")
        answer.put("Allow", ", ".join(word for word in words if word != method))

    return {
        "allow-drop": ("answers 405 without Allow (RFC 9110 15.5.6)", lambda answer: answer.drop("Allow")),
        "allow-less": ("answers 405 with an Allow that lacks a method of the resource (RFC 9110 10.2.1)", less),
    }


def of_resource(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants whose resource shows one thing in one response, and another in the next."""

    def at(*methods: str) -> Callable[[Request], bool]:
        return lambda request: re.fullmatch(exchange.path, request.path) is not None and request.method in methods

    rows: list[tuple[str, str, Callable[[Tally], Change]]] = [
        (
            "refused-as-missing",
            "answers 404 in place of 405 (RFC 9110 15.5.6)",
            edit_responses(
                lambda request: re.fullmatch(exchange.path, request.path) is not None,
                _edit_of(_missing, lambda answer: answer.status == _METHOD_NOT_ALLOWED),
            ),
        )
    ]
    if operation.method == "GET":
        tagged = _edit_of(
            lambda answer: answer.put("ETag", '"roaas"'),
            lambda answer: bool(answer.field("ETag")) and _is_success(answer),
        )
        rows += [
            ("head-missing", "answers HEAD with 404", edit_responses(at("HEAD"), _edit_of(_missing, _is_success))),
            ("head-tag", "sends another ETag for HEAD (RFC 9110 9.3.2)", edit_responses(at("HEAD"), tagged)),
            ("tag-kept", "keeps its first ETag (RFC 9110 8.8.1)", _keeping_tags(at("GET", "HEAD"))),
            (
                "list-ignored",
                "knows one tag in If-None-Match, and no list (RFC 9110 13.1.2)",
                _without("If-None-Match", at("GET"), lambda value: "," in value),
            ),
        ]
    if operation.method in {"PUT", "PATCH", "DELETE"}:
        ignored = _without("If-Match", at(operation.method), lambda _: True)
        rows.append(("match-ignored", "ignores If-Match (RFC 9110 13.1.1)", ignored))
    for name, says, make in rows:
        yield GeneratedMutant.of(name, exchange, "resource", f"{exchange.name} {says}.", make)


def _missing(answer: Response) -> None:
    answer.status, answer.reason = 404, ""


def _is_success(answer: Response) -> bool:
    return answer.status in SUCCESS


def _keeping_tags(where: Callable[[Request], bool]) -> Callable[[Tally], Change]:
    """Return a change that gives each path the strong ETag that it had at first."""

    def make(tally: Tally) -> Change:
        first: dict[str, str] = {}

        def edit(request: Request, answer: Response) -> Response | None:
            tag = answer.field("ETag")
            if not tag or tag.startswith("W/") or first.setdefault(request.path, tag) == tag:
                return None
            altered = answer.copy()
            altered.put("ETag", first[request.path])
            return altered

        return edit_responses(where, edit)(tally)

    return make


def _without(name: str, where: Callable[[Request], bool], when: Callable[[str], bool]) -> Callable[[Tally], Change]:
    """Return a change that takes a condition out of requests, counted where the device answers 2xx."""

    def alter(request: Request) -> Request | None:
        value = request.field(name)
        if value is None or not where(request) or not when(value):
            return None
        altered = request.copy()
        altered.drop(name)
        return altered

    return altering_requests(alter)
