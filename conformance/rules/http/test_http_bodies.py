"""Bodies: media types that an operation does not take, charset, and sizes (RFC 9110 8.3, 15.5.14, 15.5.16)."""

from collections.abc import Callable, Iterator

import pytest

from conformance.api.rest import by_hand
from conformance.api.rest.applicable import answered, applicable_operations
from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.number_forms import at_integer_ends, with_numbers
from conformance.api.rest.statuses import is_cut_off, is_taken, judge_status
from conformance.contract.sizes import TAKEN_OCTETS
from conformance.documents.writing import json_text
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("input"), pytest.mark.needs("rest")]
_OTHERS = (
    "text/plain",
    "application/x-www-form-urlencoded",
    "multipart/form-data; boundary=x",
    "image/png",
    "text/csv",
)
_CHARSETS = ("application/json; charset=utf-8", "application/json;charset=UTF-8", 'application/json; charset="utf-8"')
# What a number may be written as and still be the same (RFC 8259 6); zero has a sign as well.
_FORMS: tuple[Callable[[float], str], ...] = (
    "{:.17e}".format,
    "{:.17E}".format,
    lambda value: f"{value!r}e+0" if "e" not in repr(value) else repr(value),
    lambda value: f"{value!r}E-00" if "e" not in repr(value) else repr(value),
    lambda value: repr(value) if value else "-0",
    lambda value: repr(value) if value else "-0.0e-5",
)
_CHUNK_FORMS = (
    ("a chunk extension", b";part=1", b""),
    ("quoted chunk extensions", b';a="1;2";b', b""),
    ("trailer fields", b"", b"Checksum: 0\r\nX-Signed-By: nobody\r\n"),
)
# How long a client waits to be told to go on before it sends its content all the same, s.
_WAITS_S = 2.0
_TOO_LARGE = 10 * 1024 * 1024 + 1


def _valid(api: RestInterface, judge: Judge, ids: tuple[str, ...]) -> Iterator[Call]:
    """A valid request for each operation that takes JSON and is answered as one should be."""
    tried = 0
    for operation in applicable_operations(api, ids, lambda item: JSON in item.bodies, "takes JSON"):
        api.device.halt(api)
        call = example_call(api, operation)
        exchange = call.send(api)
        if is_taken(exchange):
            tried += 1
            yield call
        else:
            for id_ in ids:
                judge.note(id_, f"a valid {operation.id} is answered {exchange.came}, so it was not tried")
    api.device.halt(api)


@pytest.mark.requirement("http/unsupported-media-type")
def test_media_types_that_are_not_taken(api: RestInterface, judge: Judge) -> None:
    """A valid body under another media type is not looked at."""
    for operation in applicable_operations(
        api, ["http/unsupported-media-type"], lambda item: JSON in item.bodies, "takes JSON"
    ):
        call = example_call(api, operation)
        for media_type in api.run.effort.subsample(_OTHERS, 2):
            if media_type in operation.bodies:
                continue
            exchange = call.send(api, ("Content-Type", media_type))
            status = exchange.response.status
            judge_status(
                judge, "http/unsupported-media-type", status == 415, exchange, f"415 for a body of {media_type}"
            )


@pytest.mark.requirement("http/charset")
def test_charset_parameter(api: RestInterface, judge: Judge) -> None:
    """application/json is the same with a charset parameter as without."""
    for call in _valid(api, judge, ("http/charset",)):
        for media_type in _CHARSETS:
            exchange = call.send(api, ("Content-Type", media_type))
            judge.check(
                "http/charset",
                is_taken(exchange),
                exchange,
                f"Content-Type: {media_type} taken like {JSON}",
                cause=media_type,
            )


@pytest.mark.requirement("http/content-too-large")
def test_sizes(api: RestInterface, judge: Judge) -> None:
    """64 KiB are taken; more than 10 MiB are answered 413, or the connection is closed."""
    judge.at_risk = ("http/content-too-large",)
    for call in _valid(api, judge, ("http/content-too-large",)):
        padded = call.rewritten(api, call.body[:1] + b" " * (TAKEN_OCTETS - len(call.body)) + call.body[1:])
        exchange = padded.send(api)
        judge.check("http/content-too-large", is_taken(exchange), exchange, "a body of 64 KiB taken")
        huge = call.carrying(call.body[:1] + b" " * (_TOO_LARGE - len(call.body)) + call.body[1:])
        for fields in ((), (("Transfer-Encoding", "chunked"),)):
            _judge_too_large(api, judge, huge, fields)
        exchange = call.send(api)
        judge.check("http/content-too-large", is_taken(exchange), exchange, "the next valid request taken as ever")


def _judge_too_large(api: RestInterface, judge: Judge, call: Call, fields: tuple[tuple[str, str], ...]) -> None:
    try:
        exchange = call.send(api, *fields, fresh=True)
    except NoAnswerError as none:
        if not is_cut_off(none.unanswered):
            raise
        judge.check("http/content-too-large", True, none.unanswered, "413, or a closed connection")
        return
    status = exchange.response.status
    # A server that takes no chunked bodies at all may say so (RFC 9112 6.3, RFC 9110 15.6.2 for an old one).
    refused = {413, 411, 400, 501} if fields else {413}
    judge.check(
        "http/content-too-large",
        status in refused or is_cut_off(exchange),
        exchange,
        "413, or a closed connection",
        found=f"status {status} for a body of {_TOO_LARGE:,} octets",
        cause=f"{status} {bool(fields)}",
    )


@pytest.mark.requirement("http/chunked", "http/chunk-forms")
def test_chunked_content(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Content in chunks of one octet, of a few, and of all is what it is in one piece; also 64 KiB of it."""
    for call in _valid(api, judge, ("http/chunked",)):
        large = call.body[:1] + b" " * (TAKEN_OCTETS - len(call.body)) + call.body[1:]
        for body, size in (
            (call.body, 1),
            (call.body, 7),
            (call.body, len(call.body)),
            (large, 1000),
            (large, TAKEN_OCTETS),
        ):
            fields = (f"Content-Type: {call.media_type}", "Transfer-Encoding: chunked")
            octets = raw.head(rest, call.operation.method, call.path, *fields) + raw.chunked(body, size)
            attempt, _ = raw.read_one(rest, octets, by_hand.talk(api, octets, answers=1), call.operation.method)
            judge.check(
                "http/chunked",
                isinstance(attempt, Exchange) and (is_taken(attempt) or _knows_no_chunks(attempt)),
                attempt,
                f"{len(body)} octets in chunks of {size} taken as in one piece",
                cause=f"{attempt.came}",
            )
        for what, extension, trailers in _CHUNK_FORMS:
            fields = (f"Content-Type: {call.media_type}", "Transfer-Encoding: chunked")
            octets = raw.head(rest, call.operation.method, call.path, *fields)
            octets += raw.chunked(call.body, 9, extension, trailers)
            attempt, _ = raw.read_one(rest, octets, by_hand.talk(api, octets, answers=1), call.operation.method)
            judge.check(
                "http/chunk-forms",
                isinstance(attempt, Exchange) and (is_taken(attempt) or _knows_no_chunks(attempt)),
                attempt,
                f"chunked content with {what} taken like the same without",
                cause=f"{what} {attempt.came}",
            )


def _knows_no_chunks(exchange: Exchange) -> bool:
    """Whether a server of HTTP/1.0, which has no chunks, asks for a length (RFC 9112 6.1)."""
    return exchange.response.http_version == "HTTP/1.0" and exchange.response.status == 411


@pytest.mark.requirement("http/expect-continue")
def test_content_that_waits(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """A client that asks whether to send its content is told to go on, or answered, at once (RFC 9110 10.1.1)."""
    for call in _valid(api, judge, ("http/expect-continue",)):
        # HTTP/1.0 has no interim answers: its client sends the content without being told to.
        old = call.send(api).response.http_version == "HTTP/1.0"
        fields = (f"Content-Type: {call.media_type}", f"Content-Length: {len(call.body)}", "Expect: 100-continue")
        head = raw.head(rest, call.operation.method, call.path, *fields)
        octets = head + call.body
        came = by_hand.talk(api, octets, answers=1, cuts=(len(head),), pause_s=0.0 if old else _WAITS_S)
        attempt, _ = raw.read_one(rest, octets, came, call.operation.method)
        taken = isinstance(attempt, Exchange) and is_taken(attempt)
        judge.check(
            "http/expect-continue",
            taken and (old or came.early),
            attempt,
            "100 or a final answer before the content is sent, and then the content taken as ever",
            found=attempt.came if not taken else f"nothing in {_WAITS_S:g} s",
        )
        break


@pytest.mark.requirement("http/media-type-case")
def test_case_of_media_types(api: RestInterface, judge: Judge) -> None:
    """Media types are the same in upper case, of what is sent and of what is asked for."""
    for call in answered(api):
        for media_type in call.operation.formats:
            # A robot need not have every format; what it sends for the usual spelling, it sends for the other.
            if call.send(api, ("Accept", media_type)).response.media_type != media_type:
                continue
            exchange = call.send(api, ("Accept", media_type.upper()))
            judge.check(
                "http/media-type-case",
                exchange.response.ok and exchange.response.media_type == media_type,
                exchange,
                f"200 with {media_type} for Accept: {media_type.upper()}",
                cause=f"Accept {exchange.came}",
            )
    for call in _valid(api, judge, ("http/media-type-case",)):
        for media_type in ("Application/Json", "APPLICATION/JSON; CHARSET=UTF-8"):
            exchange = call.send(api, ("Content-Type", media_type))
            judge.check(
                "http/media-type-case",
                is_taken(exchange),
                exchange,
                f"Content-Type: {media_type} taken like {JSON}",
                cause=f"Content-Type {exchange.came}",
            )


@pytest.mark.requirement("http/json-numbers", "http/json-integers")
def test_numbers_in_json(api: RestInterface, judge: Judge) -> None:
    """A number is the same with an exponent, and zero with a sign; integers reach from end to end of their type."""
    for call in _valid(api, judge, ("http/json-numbers",)):
        for write in _FORMS:
            exchange = call.rewritten(api, with_numbers(call.value, write)).send(api)
            judge.check(
                "http/json-numbers",
                is_taken(exchange),
                exchange,
                f"{write(-1.5)} and {write(0.0)} taken as the numbers that they are",
                cause=f"{write(0.0)} {exchange.came}",
            )
    tried = 0
    for call in _valid(api, judge, ("http/json-integers",)):
        for value in at_integer_ends(call.value, call.operation.bodies[JSON].schema):
            tried += 1
            exchange = call.rewritten(api, json_text(value).encode()).send(api)
            judge.check("http/json-integers", is_taken(exchange), exchange, "the ends of an int32's range taken")
    if not tried:
        judge.unclaimed("http/json-integers", "the contract has no operation that takes an int32")
