"""Request bodies: media types, charset, sizes, chunks and JSON numbers (RFC 9110 8.3, 15.5.14, 15.5.16)."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from conformance.api.expectation import expect
from conformance.api.rest import by_hand
from conformance.api.rest.applicable import applicable_operations, working_reads
from conformance.api.rest.body_mutations import places, replaced, with_options
from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import is_cut_off, is_taken
from conformance.contract.classes import LIMIT_OCTETS, TAKEN_OCTETS
from conformance.documents.json_schema import Schema
from conformance.documents.writing import Token, json_text
from conformance.transport import raw
from conformance.transport.client import Headers
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError
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
# Forms of one number in JSON (RFC 8259 6); zero may have a sign as well.
_FORMS: tuple[Callable[[float], str], ...] = (
    "{:.17e}".format,
    "{:.17E}".format,
    lambda value: f"{value!r}e+0" if "e" not in repr(value) else repr(value),
    lambda value: f"{value!r}E-00" if "e" not in repr(value) else repr(value),
    lambda value: repr(value) if value else "-0",
    lambda value: repr(value) if value else "-0.0e-5",
)
_CHUNK_FORMS = (
    ("nothing else", b"", b""),
    ("a chunk extension", b";part=1", b""),
    ("quoted chunk extensions", b';a="1;2";b', b""),
    ("trailer fields", b"", b"Checksum: 0\r\nX-Signed-By: nobody\r\n"),
)
# How long a client waits for 100 Continue before it sends its content all the same, s.
_WAITS_S = 2.0
_TOO_LARGE = LIMIT_OCTETS + 1
# Headers that frame the content, besides Content-Length.
_FRAMINGS: tuple[Headers, ...] = ((), (("Transfer-Encoding", "chunked"),))


def _valid(api: RestInterface, judge: Judge, ids: tuple[str, ...]) -> Iterator[Call]:
    """Yield a valid request for each operation that takes JSON, where the robot accepts it."""
    for operation in applicable_operations(api, ids, lambda item: JSON in item.bodies, "takes JSON"):
        api.device.halt(api)
        call = example_call(api, operation)
        exchange = call.send(api)
        if is_taken(exchange):
            yield call
        else:
            for id_ in ids:
                judge.note(id_, f"not tried on {operation.id}: a valid request for it got {exchange.came}")
    api.device.halt(api)


def _pad(call: Call, octets: int) -> bytes:
    """Return a call's JSON body, padded with white space to ``octets`` bytes."""
    return call.body[:1] + b" " * (octets - len(call.body)) + call.body[1:]


@pytest.mark.requirement("http/unsupported-media-type")
def test_media_types_that_are_not_taken(api: RestInterface, judge: Judge) -> None:
    """Send a valid body under media types that the operation does not take."""
    id_ = "http/unsupported-media-type"
    for operation in applicable_operations(api, [id_], lambda item: JSON in item.bodies, "takes JSON"):
        call = example_call(api, operation)
        for media_type in api.run.effort.alternatives(_OTHERS, 2):
            if media_type not in operation.bodies:
                exchange = call.send(api, ("Content-Type", media_type))
                expect(judge, id_, exchange).status(415, when=f"Content-Type is {media_type}")


@pytest.mark.requirement("http/charset")
def test_charset_parameter(api: RestInterface, judge: Judge) -> None:
    """Send application/json with a charset parameter, in several forms."""
    for call in _valid(api, judge, ("http/charset",)):
        for media_type in _CHARSETS:
            exchange = call.send(api, ("Content-Type", media_type))
            expect(judge, "http/charset", exchange).accepts(f"Content-Type is {media_type}", cause=media_type)


@pytest.mark.requirement("http/content-too-large", "http/content-too-large-answered")
def test_sizes(api: RestInterface, judge: Judge) -> None:
    """Send 64 KiB, which must be accepted, and more than 10 MiB, which must get 413 or a closed connection."""
    id_ = "http/content-too-large"
    judge.at_risk = (id_,)
    for number, call in enumerate(_valid(api, judge, (id_,))):
        exchange = call.rewritten(api, _pad(call, TAKEN_OCTETS)).send(api)
        expect(judge, id_, exchange).accepts("the body has 64 KiB")
        huge = call.carrying(_pad(call, _TOO_LARGE))
        # At quick the framings take turns, so that each is tried.
        for fields in api.run.effort.alternatives(_FRAMINGS if number % 2 else _FRAMINGS[::-1], 1):
            _judge_too_large(api, judge, huge, fields)
        expect(judge, id_, call.send(api)).accepts("the request is valid and follows one that was too large")


def _judge_too_large(api: RestInterface, judge: Judge, call: Call, fields: Headers) -> None:
    attempt: Attempt
    try:
        attempt = call.send(api, *fields, fresh=True)
    except NoAnswerError as none:
        attempt = none.unanswered
        if not is_cut_off(attempt):
            raise
    # A server that takes no chunked bodies at all may say so (RFC 9112 6.3, RFC 9110 15.6.2 for an old one).
    refused = {413, 411, 400, 501} if fields else {413}
    answered = isinstance(attempt, Exchange) and attempt.response.status in refused
    expected, cause = f"status 413 when the body has {_TOO_LARGE:,} bytes", f"{attempt.came} {bool(fields)}"
    expect(judge, "http/content-too-large", attempt).that(
        answered or is_cut_off(attempt), f"{expected}, or a closed connection", cause=cause
    )
    expect(judge, "http/content-too-large-answered", attempt).that(answered, expected, cause=cause)


@pytest.mark.requirement("http/chunked", "web-server/chunk-forms")
def test_chunked_content(api: RestInterface, judge: Judge) -> None:
    """Send valid content in chunks: of one byte, of a few bytes, in one chunk, 64 KiB, with extensions and trailers.

    The robot must accept each as it accepts the same content with Content-Length.
    """
    for call in _valid(api, judge, ("http/chunked",)):
        large = _pad(call, TAKEN_OCTETS)
        for body, size in (
            (call.body, 1),
            (call.body, 7),
            (call.body, len(call.body)),
            (large, 1000),
            (large, len(large)),
        ):
            what = f"{len(body)} bytes in chunks of {size}"
            _judge_chunked(api, judge, "http/chunked", call, raw.chunked(body, size), what)
        # A server error here is the web server's, and no other one of the API: Werkzeug answers 500 to an extension.
        with judge.by_rule():
            for what, extension, trailers in _CHUNK_FORMS:
                chunks = raw.chunked(call.body, 9, extension, trailers)
                if not _judge_chunked(api, judge, "web-server/chunk-forms", call, chunks, f"chunks with {what}"):
                    break


def _judge_chunked(api: RestInterface, judge: Judge, requirement: str, call: Call, chunks: bytes, what: str) -> bool:
    """Judge whether a body is accepted in chunks; return whether its response is that of an accepted one, or 411."""
    fields = (f"Content-Type: {call.media_type}", "Transfer-Encoding: chunked")
    attempt = by_hand.ask(api, call.operation.method, call.path, *fields, body=chunks)
    refused = raw.refuses_chunks(attempt)
    return expect(judge, requirement, attempt).accepts(f"the body comes as {what}", or_else=refused)


@pytest.mark.requirement("web-server/expect-continue")
def test_content_that_waits(api: RestInterface, judge: Judge) -> None:
    """Send Expect: 100-continue, and hold the content back until a response comes (RFC 9110 10.1.1)."""
    for call in _valid(api, judge, ("web-server/expect-continue",)):
        # HTTP/1.0 has no interim responses: its client sends the content without waiting for one.
        old = call.send(api).response.http_version == "HTTP/1.0"
        method, fields = call.operation.method, (f"Content-Type: {call.media_type}", "Expect: 100-continue")
        head = raw.head(api.client, method, call.path, *fields, f"Content-Length: {len(call.body)}")
        octets = head + call.body
        came = by_hand.talk(api, octets, answers=1, cuts=(len(head),), pause_s=0.0 if old else _WAITS_S)
        attempt, _ = raw.read_one(api.client, octets, came, method)
        taken = isinstance(attempt, Exchange) and is_taken(attempt)
        expect(judge, "web-server/expect-continue", attempt).that(
            taken and (old or came.early),
            "status 100 or a final response before the content is sent, and then status 2xx",
            f"no response within {_WAITS_S:g} s before the content was sent" if taken else "",
        )
        break


@pytest.mark.requirement("http/media-type-case")
def test_case_of_media_types(api: RestInterface, judge: Judge) -> None:
    """Send media types in upper case, in Accept and in Content-Type."""
    id_ = "http/media-type-case"
    for call in working_reads(api):
        for media_type in call.operation.formats:
            # A robot need not have every format; what it sends for the usual spelling, it sends for the other.
            if call.send(api, ("Accept", media_type)).response.media_type == media_type:
                exchange = call.send(api, ("Accept", media_type.upper()))
                expect(judge, id_, exchange).that(
                    exchange.response.ok and exchange.response.media_type == media_type,
                    f"status 200 with {media_type} when Accept is {media_type.upper()}",
                    cause=f"Accept {exchange.came}",
                )
    for call in _valid(api, judge, (id_,)):
        for media_type in ("Application/Json", "APPLICATION/JSON; CHARSET=UTF-8"):
            exchange = call.send(api, ("Content-Type", media_type))
            expect(judge, id_, exchange).accepts(f"Content-Type is {media_type}", cause=f"Content-Type {exchange.came}")


@pytest.mark.requirement("http/json-numbers", "http/json-integers")
def test_numbers_in_json(api: RestInterface, judge: Judge) -> None:
    """Send numbers with exponents, zeros with a sign, and integers at both ends of their type."""
    for call in _valid(api, judge, ("http/json-numbers",)):
        for write in _FORMS:
            exchange = call.rewritten(api, with_numbers(call.value, write)).send(api)
            what = f"numbers are written like {write(-1.5)} and {write(0.0)}"
            expect(judge, "http/json-numbers", exchange).accepts(what, cause=f"{write(0.0)} {exchange.came}")
    tried = 0
    for call in _valid(api, judge, ("http/json-integers",)):
        for value in at_integer_ends(call.value, call.operation.bodies[JSON].schema):
            tried += 1
            exchange = call.rewritten(api, json_text(value).encode()).send(api)
            expect(judge, "http/json-integers", exchange).accepts("an int32 is at an end of its range")
    if not tried:
        judge.note_unclaimed("http/json-integers", "the contract has no operation that takes an int32")


_INT32_ENDS = (-(2**31), 2**31 - 1)


def with_numbers(value: Any, write: Callable[[float], str]) -> bytes:
    """Return JSON with floats written by ``write``; integers and texts stay unchanged."""

    def with_tokens(item: Any) -> Any:
        if isinstance(item, dict):
            return {name: with_tokens(part) for name, part in item.items()}
        if isinstance(item, list):
            return [with_tokens(part) for part in item]
        return Token(write(item)) if isinstance(item, float) else item

    return json_text(with_tokens(value)).encode()


def at_integer_ends(value: Any, schema: Schema) -> Iterator[Any]:
    """Yield the value with each int32 of its optional members at the minimum and maximum."""
    for whole, part in with_options(value, schema):
        for place in places(part.value, part.schema, part.path):
            if (place.schema.get("minimum"), place.schema.get("maximum")) == _INT32_ENDS:
                yield from (replaced(whole, place.path, end) for end in _INT32_ENDS)
