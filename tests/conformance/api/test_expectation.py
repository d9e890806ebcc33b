"""What a check expects of a response: which statuses are right, and what a finding says of those that are not."""

import pytest

from conformance.api.expectation import expect, is_one_of
from conformance.api.soap.calls import expect_answer, read_exchange
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.evidence import Judge

_ID = "http/allow"
_REQUEST = Request("PATCH", "http://r2/x")
_CLOSED = Unanswered(_REQUEST, "the server closed the connection without a response", NoAnswer.CLOSED)
_LATE = Unanswered(_REQUEST, "no response within 10 s", NoAnswer.TIMEOUT)


@pytest.fixture
def judge() -> Judge:
    return Judge({_ID})


def _exchange(status: int, *headers: tuple[str, str], body: bytes = b"") -> Exchange:
    return Exchange(_REQUEST, Response(status, headers, body, 1.0))


def _finding(judge: Judge):
    (finding,) = judge.evidence[_ID].findings.values()
    return finding


@pytest.mark.parametrize(
    ("status", "allowed", "expected"),
    [(404, (404,), True), (404, ("4xx", 501), True), (501, ("4xx", 501), True), (500, ("4xx", 501), False)],
)
def test_statuses_and_classes_of_them(status, allowed, expected):
    assert is_one_of(status, allowed) is expected


def test_a_finding_names_the_statuses_and_the_circumstance(judge):
    assert not expect(judge, _ID, _exchange(500)).status("4xx", 501, when="the method is unknown")
    assert _finding(judge).expected == "status 4xx or 501 when the method is unknown"
    assert _finding(judge).observed == "500"
    assert judge.evidence[_ID].cases == 1


def test_each_status_is_a_cause_of_its_own(judge):
    for status in (404, 404, 403):
        expect(judge, _ID, _exchange(status)).status(405)
    assert sorted(item.seen for item in judge.evidence[_ID].findings.values()) == [1, 2]


def test_a_closed_connection_is_right_only_where_that_is_allowed(judge):
    assert expect(judge, _ID, _CLOSED).status(400, closed=True)
    assert not expect(judge, _ID, _LATE).status(400, closed=True)
    assert not expect(judge, _ID, _CLOSED).status(400)
    assert {item.expected for item in judge.evidence[_ID].findings.values()} == {
        "status 400 or a closed connection",
        "status 400",
    }


def test_a_response_may_be_right_for_another_reason(judge):
    assert expect(judge, _ID, _exchange(302)).status(404, or_else=True)
    assert expect(judge, _ID, _CLOSED).accepts("the body is chunked", or_else=True)
    assert expect(judge, _ID, _exchange(409)).accepts("the body is chunked")


def test_header_fields_and_media_types(judge):
    exchange = _exchange(405, ("Allow", "GET"), ("Content-Type", "text/plain; charset=utf-8"))
    assert expect(judge, _ID, exchange).header("allow")
    assert expect(judge, _ID, exchange).media_type("application/json", "text/plain")
    assert not expect(judge, _ID, exchange).header("Date")
    assert "no header field Date" in _finding(judge).observed


def test_a_finding_on_soap_describes_the_message(judge):
    body = (
        b'<e:Envelope xmlns:e="http://schemas.xmlsoap.org/soap/envelope/"><e:Body><e:Fault><faultcode>e:Client</faultcode>'
        b"<faultstring>no</faultstring></e:Fault></e:Body></e:Envelope>"
    )
    answer = read_exchange(_exchange(500, ("Content-Type", "text/xml"), body=body))
    assert expect_answer(judge, _ID, answer).fault("Client", "the body is empty")
    assert not expect_answer(judge, _ID, answer).succeeds("the message is valid")
    assert _finding(judge).expected == "status 2xx with a SOAP message when the message is valid"
    assert "fault Client: 'no'" in _finding(judge).observed
