"""The same request as different clients write it, in the pieces in which it may come (RFC 9110 5; RFC 9112 2, 5, 9)."""

import pytest

from conformance.api.rest import by_hand
from conformance.api.rest.applicable import answered
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, Unanswered
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# A media type that no robot has: to ask for it is seen by the answer, where there is one format only.
_NOTHING = "image/png"
# How a field may be written (RFC 9110 5.1, RFC 9112 5): its name in any case, white space around its value or none.
_FIELDS = ("accept: {}", "ACCEPT: {}", "aCCept:{}", "Accept:\t{} \t", "Accept:   {}")
# One list in several lines (RFC 9110 5.3): the last one holds what the robot has, or the first.
_LINES = (("Accept: image/png", "Accept: image/webp;q=0.5", "Accept: {}"), ("Accept: {}", "Accept: image/webp;q=0.5"))
# So much later than its answer a connection may end, s.
_ENDS_S = 2.0
# Between two pieces of a request, s; so many pieces make the longest that any network would.
_PIECES, _APART_S = 12, 0.003


def _asked(api: RestInterface, path: str, *fields: str, cuts: tuple[int, ...] = ()) -> Attempt:
    octets = raw.head(api.client, "GET", path, *fields)
    came = by_hand.talk(api, octets, answers=1, cuts=cuts, pause_s=_APART_S)
    return raw.read_one(api.client, octets, came, "GET")[0]


def _sort(attempt: Attempt) -> tuple[int, str]:
    """Status and format of an answer, by which it is seen what was understood."""
    if isinstance(attempt, Unanswered):
        return 0, attempt.problem
    return attempt.response.status, attempt.response.media_type


def _told_apart(api: RestInterface) -> tuple[Call, str, tuple[int, str]] | None:
    """A read, and a media type by which its answer differs from the usual one; None where there is no such."""
    for call in answered(api)[:1]:
        usual = _sort(_asked(api, call.path))
        for media_type in (*call.operation.formats, _NOTHING):
            other = _sort(_asked(api, call.path, f"Accept: {media_type}"))
            if other not in {usual, (0, other[1])}:
                return call, media_type, other
    return None


@pytest.mark.phase("describe")
@pytest.mark.requirement("http/field-forms", "http/field-lines")
def test_fields_in_any_form(api: RestInterface, judge: Judge) -> None:
    """A field is the same however its name and the white space around its value are written, and in several lines."""
    found = _told_apart(api)
    if found is None:
        for id_ in ("http/field-forms", "http/field-lines"):
            judge.unclaimed(id_, "whatever is asked for, one format comes")
        return
    call, media_type, wanted = found
    for form in _FIELDS:
        line = form.format(media_type)
        attempt = _asked(api, call.path, line)
        judge.check(
            "http/field-forms",
            _sort(attempt) == wanted,
            attempt,
            f"{wanted} for {line!r}, as for Accept: {media_type}",
            cause=form,
        )
    for lines in _LINES:
        attempt = _asked(api, call.path, *(line.format(media_type) for line in lines))
        judge.check(
            "http/field-lines",
            _sort(attempt) == wanted,
            attempt,
            f"{wanted} for a list of {len(lines)} lines, of which one has {media_type}",
        )


@pytest.mark.phase("describe")
@pytest.mark.requirement("http/octet-stream")
def test_requests_in_pieces(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Where one segment ends and the next one begins means nothing."""
    for call in answered(api)[:2]:
        fields = ("Accept: application/json", "User-Agent: " + "roaas " * 4)
        wanted = _sort(_asked(api, call.path, *fields))
        length = len(raw.head(rest, "GET", call.path, *fields))
        even = tuple(length * piece // _PIECES for piece in range(1, _PIECES))
        # At the end: between the carriage returns and the line feeds.
        for cuts in (even, (1, 2, 3, 4), (length - 3, length - 2, length - 1)):
            attempt = _asked(api, call.path, *fields, cuts=cuts)
            judge.check(
                "http/octet-stream",
                _sort(attempt) == wanted,
                attempt,
                f"{wanted} for the same in {len(cuts) + 1} pieces",
            )


@pytest.mark.phase("describe")
@pytest.mark.requirement("http/close", "http/old-client")
def test_the_end_of_a_connection(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Who asks for the end of the connection gets it, and HTTP/1.0 knows no chunks."""
    judge.at_risk = ("http/close",)
    for call in answered(api)[:1]:
        octets = raw.head(rest, "GET", call.path, "Connection: close")
        came = by_hand.talk(api, octets, timeout_s=_ENDS_S + 4 * api.run.effort.usual_ms / 1000)
        attempt, _ = raw.read_one(rest, octets, came, "GET")
        judge.check(
            "http/close",
            came.closed,
            attempt,
            "the answer to a request with Connection: close, and then the end of the connection",
            found="it stays open",
        )
        octets = octets.replace(b" HTTP/1.1\r\n", b" HTTP/1.0\r\n", 1)
        attempt, _ = raw.read_one(rest, octets, by_hand.talk(api, octets, answers=1), "GET")
        coded = isinstance(attempt, Exchange) and attempt.response.header("transfer-encoding")
        judge.check(
            "http/old-client",
            not coded,
            attempt,
            "an answer without Transfer-Encoding to a client of HTTP/1.0",
            found=f"Transfer-Encoding: {coded}",
        )
