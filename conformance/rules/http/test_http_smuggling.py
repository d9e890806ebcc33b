"""Request smuggling: requests whose end or whose headers two servers may read differently (RFC 9112 11.2).

Each is a GET followed by another one. A server may reject the first, or close the connection after it. If it answers
both, the second has to be the one that was sent: what lies between is neither lost nor taken for a request.
"""

from dataclasses import dataclass
from http import HTTPStatus

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import CRASHES
from conformance.transport import raw
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Unanswered
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("input"), pytest.mark.needs("rest")]
_BOTH = "web-server/length-and-chunks"
_CLOSED = "web-server/length-and-chunks-closed"
_LINES = "web-server/header-lines"
_COLON = "web-server/space-before-colon"
_CHUNKED, _CHUNKS = "Transfer-Encoding: chunked", raw.chunked(b"abcde", 5)
# A length shorter than the chunks and the next request: a server that uses it reads garbage as the next request.
_SHORT = "Content-Length: 3"
_THINK_S = 3.0
# Tries: a robot that crashes at each of them was confused by the request; rarer crashes break another rule.
_TRIES = 3


@dataclass(frozen=True)
class _Pair:
    """The responses to two requests in a row; second is None if there was none.

    Attributes:
        first, second: what came.
        closed: whether the robot closed the connection.
    """

    first: Attempt
    second: Attempt | None
    closed: bool

    @property
    def has_crash(self) -> bool:
        """Return whether either request made the robot crash."""
        return any(isinstance(came, Exchange) and came.response.status in CRASHES for came in (self.first, self.second))

    @property
    def is_rejected(self) -> bool:
        """Whether the first request was rejected; 501 is for a transfer coding that an old server does not know."""
        if isinstance(self.first, Unanswered):
            return self.first.kind is NoAnswer.CLOSED
        status = self.first.response.status
        return (
            HTTPStatus.BAD_REQUEST <= status <= HTTPStatus.NOT_IMPLEMENTED
            and status != HTTPStatus.INTERNAL_SERVER_ERROR
        )

    @property
    def is_taken(self) -> bool:
        """Whether the first request was processed."""
        return isinstance(self.first, Exchange) and self.first.response.ok

    @property
    def fault(self) -> str:
        """Return the evidence that the requests were read differently from how they were sent; empty if none."""
        if self.is_rejected:
            return ""
        if not self.is_taken:
            return self.first.came
        if self.second is None:
            return "" if self.closed else "no response to the request behind it, and the connection stays open"
        fine = isinstance(self.second, Exchange) and not self._is_rejection(self.second)
        return "" if fine else f"{self.second.came} for the valid request behind it"

    @staticmethod
    def _is_rejection(exchange: Exchange) -> bool:
        return HTTPStatus.BAD_REQUEST <= exchange.response.status < HTTPStatus.INTERNAL_SERVER_ERROR


def _send(api: RestInterface, path: str, *fields: str, body: bytes = b"") -> _Pair:
    """Send a pair; send it again if the robot crashes."""
    for _ in range(_TRIES):
        pair = _send_once(api, path, *fields, body=body)
        if not pair.has_crash:
            break
    return pair


def _send_once(api: RestInterface, path: str, *fields: str, body: bytes = b"") -> _Pair:
    """Send a GET with headers and body as given, and a valid one behind it, and close the connection."""
    first = raw.head(api.client, "GET", path, *fields) + body
    octets = first + raw.head(api.client, "GET", path, "Connection: close")
    longest = api.client.connection.timeout_s
    came = raw.talk(
        api.client, octets, timeout_s=min(longest, _THINK_S + 4 * api.run.effort.usual_ms / 1000), answers=2
    )
    if not came.octets and not came.closed:
        # The network may hold a response up for longer than a robot may take.
        came = raw.talk(api.client, octets, timeout_s=longest, answers=2)
    one, behind = raw.read_one(api.client, octets, came, "GET")
    two = raw.read_one(api.client, octets, raw.rest_of(came, behind), "GET")[0] if behind else None
    return _Pair(one, two, came.closed)


def _judge(judge: Judge, requirement: str, pair: _Pair, what: str) -> None:
    expect(judge, requirement, pair.second or pair.first).that(
        not pair.fault, f"a rejection of the request with {what}, or no effect of it on the request behind", pair.fault
    )


def _path(api: RestInterface, *ids: str) -> str:
    """Return a path for GET that returns 2xx; empty, with a note at the requirements, if there is none."""
    for call in reads(api):
        if call.send(api).response.ok:
            return call.path
    for id_ in ids:
        api.run.judge.note(id_, "no read got status 2xx")
    return ""


@pytest.mark.requirement(_BOTH, _CLOSED)
def test_length_and_chunks(api: RestInterface, judge: Judge) -> None:
    """Send Content-Length together with chunks: the chunks count, or the request is rejected (RFC 9112 6.1, 6.3)."""
    judge.at_risk = (_BOTH,)
    path = _path(api, _BOTH, _CLOSED)
    for fields in ((_SHORT, _CHUNKED), (_CHUNKED, _SHORT)) if path else ():
        pair = _send(api, path, *fields, body=_CHUNKS)
        _judge(judge, _BOTH, pair, "Transfer-Encoding and Content-Length")
        closed = pair.closed and pair.second is None
        expect(judge, _CLOSED, pair.first).that(
            closed or not pair.is_taken,
            "a closed connection after the response to a request with Transfer-Encoding and Content-Length",
            "another response on the same connection" if pair.second else "a connection that stays open",
        )


@pytest.mark.requirement(_LINES, _COLON)
def test_lines_of_the_head(api: RestInterface, judge: Judge) -> None:
    """Hide a Content-Length behind a bare CR, a fold and a space; end a line in a bare LF (RFC 9112 2.2, 5.1, 5.2)."""
    judge.at_risk = (_LINES,)
    path = _path(api, _LINES, _COLON)
    for what, fields in (
        (
            ("a bare CR in a header", f"X-Roaas: a\r{_SHORT}"),
            ("a header that is folded", f"X-Roaas: a\r\n {_SHORT}"),
            ("a bare LF at the end of a header", "X-Roaas: a\nX-Roaas-Too: b"),
            ("a space before the colon of Content-Length", _SHORT.replace(":", " :")),
        )
        if path
        else ()
    ):
        _judge(judge, _LINES, _send(api, path, fields), what)
    if path:
        pair = _send(api, path, "X-Roaas : a")
        expect(judge, _COLON, pair.first).status(400, when="there is a space before the colon of a header")
