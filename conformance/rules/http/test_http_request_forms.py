"""One request in the notations that real clients use, and in several TCP segments (RFC 9110 5; RFC 9112 2, 5, 9)."""

from http import HTTPStatus

import pytest

from conformance.api.expectation import expect
from conformance.api.rest import by_hand
from conformance.api.rest.applicable import working_reads
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, Unanswered
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# A media type that no robot has: a response to it differs, even where there is only one format.
_NOTHING = "image/png"
# How a field may be written (RFC 9110 5.1, RFC 9112 5): its name in any case, white space around its value or none.
_FIELDS = ("accept: {}", "ACCEPT: {}", "aCCept:{}", "Accept:\t{} \t", "Accept:   {}")
# One list in several lines (RFC 9110 5.3): the last one holds what the robot has, or the first.
_LINES = (("Accept: image/png", "Accept: image/webp;q=0.5", "Accept: {}"), ("Accept: {}", "Accept: image/webp;q=0.5"))
# Time in which the connection must end after the response, s.
_ENDS_S = 2.0
_TRIES = 3
_PIECES = 12  # pieces in which a request is sent
_APART_S = 0.003  # pause between two pieces, s


def _ask(api: RestInterface, path: str, *fields: str, cuts: tuple[int, ...] = ()) -> Attempt:
    return by_hand.ask(api, "GET", path, *fields, cuts=cuts, pause_s=_APART_S)


def _kind(attempt: Attempt) -> tuple[int, str]:
    """Return status and media type of a response, which show how the robot understood the request."""
    if isinstance(attempt, Unanswered):
        return 0, attempt.problem
    return attempt.response.status, attempt.response.media_type


def _usual_kind(api: RestInterface, path: str, *fields: str) -> tuple[int, str]:
    """Return the kind that other responses are compared with: not that of a server error now and then."""
    for _ in range(_TRIES):
        kind = _kind(_ask(api, path, *fields))
        if kind[0] < HTTPStatus.INTERNAL_SERVER_ERROR:
            break
    return kind


def _kind_text(kind: tuple[int, str]) -> str:
    """Return status and media type in words."""
    status, media_type = kind
    return f"status {status} with {media_type}" if status and media_type else f"{media_type or f'status {status}'}"


def _telling_read(api: RestInterface) -> tuple[Call, str, tuple[int, str]] | None:
    """Return a GET, an Accept that changes its response, and that response's kind; None if there is no such GET."""
    for call in working_reads(api)[:1]:
        usual = _usual_kind(api, call.path)
        for media_type in (*call.operation.formats, _NOTHING):
            other = _usual_kind(api, call.path, f"Accept: {media_type}")
            if other not in {usual, (0, other[1])}:
                return call, media_type, other
    return None


@pytest.mark.phase("settling")
@pytest.mark.requirement("web-server/field-forms", "web-server/field-lines")
def test_fields_in_any_form(api: RestInterface, judge: Judge) -> None:
    """Write Accept in other letters, with other white space, and in several lines."""
    found = _telling_read(api)
    if found is None:
        for id_ in ("web-server/field-forms", "web-server/field-lines"):
            judge.note_unclaimed(id_, "the robot responds alike whatever Accept is")
        return
    call, media_type, wanted = found
    for form in _FIELDS:
        line = form.format(media_type)
        attempt = _ask(api, call.path, line)
        expected = f"{_kind_text(wanted)} when the field is {line!r}, as with 'Accept: {media_type}'"
        expect(judge, "web-server/field-forms", attempt).that(_kind(attempt) == wanted, expected, cause=form)
    for lines in _LINES:
        attempt = _ask(api, call.path, *(line.format(media_type) for line in lines))
        expected = f"{_kind_text(wanted)} when Accept stands in {len(lines)} lines, one of them with {media_type}"
        expect(judge, "web-server/field-lines", attempt).that(_kind(attempt) == wanted, expected)


@pytest.mark.phase("settling")
@pytest.mark.requirement("http/octet-stream")
def test_requests_in_pieces(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send requests in several TCP segments."""
    for call in working_reads(api, "http/octet-stream")[:2]:
        fields = ("Accept: application/json", "User-Agent: " + "roaas " * 4)
        wanted = _usual_kind(api, call.path, *fields)
        length = len(raw.head(rest, "GET", call.path, *fields))
        even = tuple(length * piece // _PIECES for piece in range(1, _PIECES))
        # At the end: between the carriage returns and the line feeds.
        for cuts in (even, (1, 2, 3, 4), (length - 3, length - 2, length - 1)):
            attempt = _ask(api, call.path, *fields, cuts=cuts)
            expected = f"{_kind_text(wanted)} when the request comes in {len(cuts) + 1} segments, as in one"
            expect(judge, "http/octet-stream", attempt).that(_kind(attempt) == wanted, expected)


@pytest.mark.phase("settling")
@pytest.mark.requirement("web-server/close", "web-server/old-client")
def test_the_end_of_a_connection(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send Connection: close, and requests of an HTTP/1.0 client, which does not know chunked encoding."""
    judge.at_risk = ("web-server/close",)
    for call in working_reads(api, "web-server/close", "web-server/old-client")[:1]:
        octets = raw.head(rest, "GET", call.path, "Connection: close")
        came = by_hand.talk(api, octets, timeout_s=_ENDS_S + 4 * api.run.effort.usual_ms / 1000)
        attempt, _ = raw.read_one(rest, octets, came, "GET")
        expected, found = "a closed connection after the response to Connection: close", "a connection that stays open"
        expect(judge, "web-server/close", attempt).that(came.closed, expected, found)
        octets = octets.replace(b" HTTP/1.1\r\n", b" HTTP/1.0\r\n", 1)
        attempt = by_hand.ask_octets(api, octets)
        coded = isinstance(attempt, Exchange) and attempt.response.header("transfer-encoding")
        expected = "no Transfer-Encoding when the request is HTTP/1.0"
        expect(judge, "web-server/old-client", attempt).that(not coded, expected, f"Transfer-Encoding: {coded}")
