"""Framing: requests that no client library would send, and responses read octet by octet (RFC 9112)."""

import pytest

from conformance.api.expectation import expect
from conformance.api.rest import by_hand
from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.scenarios.scenario import NoOccasionError
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, NoAnswer, Unanswered
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# How long a robot may take to refuse octets that are no request before it counts as waiting for more, s.
_THINK_S = 3.0
_IN_ALL = 56
# After this many timeouts, the device gets no further malformed requests.
_SILENT = 2
_HOST, _LENGTHS, _FORM = "web-server/host-invalid", "web-server/content-length-conflict", "web-server/target-form"
_GARBAGE = (
    b"ROBOT\r\n\r\n",
    b"\x00\x01\x02\x03\xff\xfe\r\n\r\n",
    b"GET / JUNK/1.1\r\nHost: robot\r\n\r\n",
    b"GET / HTTP/x.y\r\nHost: robot\r\n\r\n",
    b"one two three four five\r\nHost: robot\r\n\r\n",
    b'{"x": 0.1}\r\n\r\n',
)


def _first(api: RestInterface) -> Call:
    """Return a GET that every robot of the contract has, without parameters where possible."""
    calls = [call for call in reads(api) if not call.operation.optional] or reads(api)
    if not calls:
        raise NoOccasionError("no operation that only reads may be called")
    return min(calls, key=lambda call: "?" in call.path)


@pytest.mark.phase("settling")
@pytest.mark.requirement("http/framing")
def test_every_octet_of_an_answer(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Read responses from the socket: a status line, valid fields, and exactly as many bytes as announced.

    Client libraries ignore surplus bytes. The check reads often enough to notice a fault in one of fifty responses.
    """
    calls = reads(api)
    turns = -(-_IN_ALL // max(1, len(calls))) if not api.run.effort.slow else 1
    enough = silent = 0
    for turn, call in enumerate(calls * turns):
        for method in ("GET", "OPTIONS") if turn < len(calls) else ("GET",):
            octets = raw.head(rest, method, call.path, "Accept: application/json", "Connection: close")
            came = by_hand.talk(api, octets, answers=enough)
            # A robot that does not close fails http/close; here the suite waits for the end only once.
            enough = enough if came.closed else 1
            attempt, surplus = raw.read_one(rest, octets, came, method)
            fault = attempt.problem if isinstance(attempt, Unanswered) else ""
            if surplus:
                fault = f"{len(surplus)} bytes after the response: {surplus[:40]!r}"
            expect(judge, "http/framing", attempt).that(not fault, "one well-framed response", fault)
            silent += isinstance(attempt, Unanswered) and attempt.kind is NoAnswer.TIMEOUT
            if silent == _SILENT:
                return


@pytest.mark.phase("settling")
@pytest.mark.requirement("http/framing", "http/head-no-body")
def test_answers_stay_aligned(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send two requests at once: the second response begins where the first one ends, also after HEAD."""
    path = _first(api).path
    for method in ("GET", "HEAD", "OPTIONS"):
        octets = raw.head(rest, method, path) + raw.head(rest, "GET", path, "Connection: close")
        came = by_hand.talk(api, octets)
        attempt, behind = raw.read_one(rest, octets, came, method)
        if behind:
            # Nothing behind is fine: a robot may close after one response.
            attempt, behind = raw.read_one(rest, octets, raw.rest_of(came, behind), "GET")
        fault = attempt.problem if isinstance(attempt, Unanswered) else ""
        if behind:
            fault = f"{len(behind)} bytes after the second response"
        expected = f"two well-framed responses, to {method} and GET"
        expect(judge, "http/framing", attempt).that(not fault, expected, fault)


@pytest.mark.phase("input")
@pytest.mark.requirement("web-server/host-missing", "web-server/host-twice", "web-server/host-repeated", _LENGTHS)
def test_fields_that_have_to_be_refused(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send requests without Host, with two, and with two lengths; the robot must reject them (RFC 9112 3.2, 6.3)."""
    path = _first(api).path
    host = f"Host: {rest.authority}"
    for id_, closing, octets in (
        ("web-server/host-missing", False, raw.head(rest, "GET", path, host=False)),
        ("web-server/host-repeated", False, raw.head(rest, "GET", path, host)),
        ("web-server/host-twice", False, raw.head(rest, "GET", path, "Host: another.example")),
        (_LENGTHS, True, raw.head(rest, "GET", path, "Content-Length: 0", "Content-Length: 5")),
        (_LENGTHS, True, raw.head(rest, "GET", path, "Content-Length: 5", "Content-Length: 0")),
    ):
        judge.at_risk = (id_,)
        expect(judge, id_, _ask_patiently(api, octets)).status(400, closed=closing)


@pytest.mark.phase("input")
@pytest.mark.requirement(_HOST)
def test_hosts_that_are_none(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send Host values with a slash and with a space, which no host has; the robot must reject them (RFC 9112 3.2)."""
    judge.at_risk = (_HOST,)
    path = _first(api).path
    for host in (f"{rest.authority}/x", f"{rest.authority} x"):
        attempt = _ask_patiently(api, raw.head(rest, "GET", path, f"Host: {host}", host=False))
        expect(judge, _HOST, attempt).status(400, when=f"Host is {host!r}")


@pytest.mark.phase("input")
@pytest.mark.requirement(_FORM)
def test_targets_of_another_methods_form(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Send GET with the targets of CONNECT and OPTIONS, and with a relative path (RFC 9112 3, 3.2.3, 3.2.4)."""
    judge.at_risk = (_FORM,)
    line, fields = raw.head(rest, "GET", _first(api).path).split(b"\r\n", 1)
    relative = line.split(b" ")[1].removeprefix(b"/")
    for target in (rest.authority.encode(), b"*", *([relative] if relative else ())):
        attempt = _ask_patiently(api, b"GET %b HTTP/1.1\r\n%b" % (target, fields))
        expect(judge, _FORM, attempt).status("4xx", "3xx", 501, 505, closed=True)


@pytest.mark.phase("input")
@pytest.mark.requirement("web-server/malformed-request")
def test_octets_that_are_no_request(api: RestInterface, judge: Judge) -> None:
    """Send bytes that are not HTTP: the robot must respond 4xx or close, and still serve the next request."""
    judge.at_risk = ("web-server/malformed-request",)
    for octets in _GARBAGE:
        attempt, _ = _ask_by_hand(api, octets)
        expect(judge, "web-server/malformed-request", attempt).status("4xx", 505, closed=True)
    _first(api).send(api)


def _ask_patiently(api: RestInterface, octets: bytes) -> Attempt:
    """Send bytes as `_ask_by_hand` does, twice where the network may hold a response up for longer than a robot may."""
    attempt, came = _ask_by_hand(api, octets)
    if not came.octets and not came.closed:
        attempt, _ = _ask_by_hand(api, octets, api.client.connection.timeout_s)
    return attempt


def _ask_by_hand(api: RestInterface, octets: bytes, most_s: float = _THINK_S) -> tuple[Attempt, raw.RawAnswer]:
    """Send bytes over a socket; return the outcome within ``most_s`` seconds as an attempt and as raw bytes."""
    patience_s = min(api.client.connection.timeout_s, most_s + 4 * api.run.effort.usual_ms / 1000)
    came = raw.talk(api.client, octets, timeout_s=patience_s, answers=1)
    return raw.read_one(api.client, octets, came, "GET")[0], came
