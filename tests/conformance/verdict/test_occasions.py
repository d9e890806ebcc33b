"""Each requirement says by which requests it was judged."""

import pytest

from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.evidence import Judge, occasion_of

_URL = "http://robot/state"


def _exchange(method: str, sent: str = "", came: str = "", status: int = 200, **more: str) -> Exchange:
    headers = tuple({**({"Content-Type": sent} if sent else {}), **more}.items())
    response = Response(status, (("Content-Type", came),) if came else (), b"", 1.0)
    return Exchange(Request(method, _URL, headers, b"x" if sent else b""), response)


@pytest.mark.parametrize(
    ("attempt", "occasion"),
    [
        (_exchange("GET", came="application/json"), "GET JSON"),
        (_exchange("GET", came="application/problem+json"), "GET JSON"),
        (_exchange("GET", came="application/xml; charset=utf-8"), "GET XML"),
        (_exchange("GET", came="text/plain"), "GET text"),
        (_exchange("GET", came="image/png"), "GET other"),
        (_exchange("DELETE"), "DELETE without body"),
        (_exchange("PUT", sent="text/xml", came="application/json"), "PUT XML"),
        (_exchange("POST", sent="text/xml", came="text/xml", SOAPAction='""'), "SOAP"),
        (Exchange(Request("GET", _URL, raw=b"GET / HTTP/1.1\r\n\r\n"), Response(200, (), b"", 1.0)), "raw bytes"),
        (Unanswered(Request("GET", _URL), "no response", NoAnswer.TIMEOUT), "GET without body"),
    ],
)
def test_an_occasion_is_named_by_interface_method_and_format(attempt: Attempt, occasion: str) -> None:
    assert occasion_of(attempt) == occasion


def test_cases_are_counted_by_occasion_and_after_a_refusal() -> None:
    judge = Judge(["http/date"])
    for attempt in (_exchange("GET"), _exchange("PUT", sent="text/xml", status=400), _exchange("GET")):
        judge.note_sent(attempt)
        judge.check("http/date", True, attempt, "a date")
    judge.check("http/date", True, _exchange("GET"), "a date")
    judge.check("http/date", True, None, "a date")
    evidence = judge.evidence["http/date"]
    assert evidence.cases == 5
    assert evidence.occasions == {"GET without body": 3, "PUT XML": 1, "after a refusal": 1}
