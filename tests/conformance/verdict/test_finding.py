"""A finding's text says what the suite did, what it expected by which rule, what it got, and how often."""

import pytest

from conformance.contract.classes import CauseKind
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.evidence import MAX_FINDINGS, Judge, occasion_of
from conformance.verdict.finding import Again, Showing, in_full, kind_of
from conformance.verdict.run import Run

_ID = "rest-resources/pose-type"
_GET = Request("GET", "http://r2:8080/robot/pose/", (("Host", "r2:8080"), ("Accept", "application/json")))
_PAGE = Response(404, (("Content-Type", "text/html"),), b"<p>no</p>", 1.0)


def _finding(exchange, expected="200 with a complete Odometry", requirement=_ID, **given):
    judge = Run().judge
    judge.begin("test_pose.py::test_type")
    judge.check(requirement, False, exchange, expected, **given)
    return judge.met[-1]


def test_a_text_has_all_its_parts():
    assert _finding(Exchange(_GET, _PAGE)).text == (
        "Sent `GET /robot/pose/` with `Accept: application/json`. Expected 200 with a complete Odometry "
        "(rest-resources/pose-type, contract.md#poses; paper, Table 1). Got 404, text/html."
    )


@pytest.mark.parametrize(
    ("found", "observed"),
    [
        ("one", "404, text/html: one"),
        ("a number", "404, text/html: a number"),
        ("status 404", "404, text/html"),
        ("status 404, text/html", "404, text/html"),
        ("status 404 without Retry-After", "404, text/html without Retry-After"),
        ("404 with text/html", "404 with text/html"),
        ("PUT /robot/pose/ is answered 404", "404, text/html"),
    ],
)
def test_what_a_check_found_is_never_shown_alone(found, observed):
    assert _finding(Exchange(_GET, _PAGE), found=found).observed == observed


def test_how_often_a_failure_was_seen_and_came_back_is_in_the_text():
    judge = Run().judge
    for _ in range(2):
        judge.check(_ID, False, Exchange(_GET, _PAGE), "200")
    finding = judge.met[-1]
    assert finding.text.endswith("Got 404, text/html. Seen 2 times.")
    finding.again = Again(5, 5)
    assert finding.text.endswith("Repeated 5 times: failed each time.")
    finding.again = Again(1, 5)
    assert "the request failed once: the failure is intermittent, or depends on the device's state" in finding.text
    finding.again = Again(5, 5, judged=False)
    assert finding.text.endswith("Repeated 5 times: the same kind of response each time.")


def test_what_is_special_in_a_request_is_shown():
    put = Request(
        "PUT", "http://r2/a", (("Host", "r2"), ("Accept", "*/*"), ("Content-Type", "text/csv")), b"1,2\n" + b"x" * 500
    )
    text = _finding(Exchange(put, _PAGE)).text
    assert "Sent `PUT /a` with `Content-Type: text/csv` and the body `1,2\\nxxx" in text
    assert "(504 bytes in all)" in text
    by_hand = Request("GET", "http://r2/", raw=b"GET /robot/pose/ HTTP/1.1\r\nHost:\r\n\r\n")
    finding = _finding(Exchange(by_hand, _PAGE))
    assert finding.subject == "GET /robot/pose/"
    assert "Sent the bytes `GET /robot/pose/ HTTP/1.1\\r\\nHost:\\r\\n\\r\\n`." in finding.text


def test_without_a_request_the_check_or_a_subject_is_named():
    assert _finding(None, found="0.4 m").text.startswith("Tested by the check test_pose.py::test_type. Expected")
    given = _finding(None, "at most 0.1 m", found="0.4 m", subject="the drift at rest")
    assert given.text == (
        "Tested the drift at rest. Expected at most 0.1 m "
        "(rest-resources/pose-type, contract.md#poses; paper, Table 1). Got 0.4 m."
    )
    assert in_full(given) == given.text


def test_a_failed_check_shows_a_command_that_repeats_it():
    assert in_full(_finding(Exchange(_GET, _PAGE))).endswith("http://r2:8080/robot/pose/")


_JSON = (("Content-Type", "application/json"),)
_XML = (("Content-Type", "text/xml"),)


@pytest.mark.parametrize(
    ("exchange", "kind"),
    [
        (Unanswered(_GET, "", NoAnswer.CLOSED), CauseKind.NO_RESPONSE),
        (Unanswered(_GET, "", NoAnswer.REFUSED), CauseKind.NO_RESPONSE),
        (Unanswered(_GET, "", NoAnswer.TIMEOUT), CauseKind.HANG),
        (Unanswered(_GET, "", NoAnswer.CIRCUIT_OPEN), CauseKind.HANG),
        (Unanswered(_GET, "", NoAnswer.MALFORMED), CauseKind.UNREADABLE),
        (Exchange(_GET, Response(200, _JSON, b'{"x":', 1.0)), CauseKind.UNREADABLE),
        (Exchange(_GET, Response(200, _XML, b"<a>", 1.0)), CauseKind.UNREADABLE),
        (Exchange(_GET, Response(200, _JSON, b'{"x": 1}', 1.0)), CauseKind.RULE),
        (Exchange(_GET, Response(503, (), b"", 1.0)), CauseKind.SERVER_ERROR),
        (Exchange(_GET, Response(500, _XML, b"<e:Body><e:Fault><faultcode/></e:Fault></e:Body>", 1.0)), CauseKind.RULE),
        (Exchange(_GET, _PAGE), CauseKind.RULE),
        (None, CauseKind.RULE),
    ],
)
def test_kinds_of_causes(exchange, kind):
    assert kind_of(exchange) is kind


def test_causes_beyond_those_that_are_kept_share_one_finding_which_says_so_and_names_their_operations():
    judge = Judge({"http/x"})
    for number in range(MAX_FINDINGS + 3):
        label = f"GET /{number}"
        judge.check("http/x", False, None, "thing", cause=label, operations=[Showing(label)])
    *own, rest = judge.evidence["http/x"].findings.values()
    assert [finding.seen for finding in own] == [1] * MAX_FINDINGS
    assert (rest.seen, list(rest.operations)) == (3, [f"GET /{MAX_FINDINGS + i}" for i in range(3)])
    assert "It stands for all further causes" in rest.text


def test_one_server_error_behind_many_paths_is_one_finding_with_all_operations_and_how_often():
    judge = Judge({"http/x"})
    judge.concerned = lambda request: [f"{request.method} {request.target}"]
    for number in (*range(200), 7):
        exchange = Exchange(Request("OPTIONS", f"http://r2/{number}"), Response(500, (), b"oops at %d" % number, 1.0))
        judge.check("http/x", False, exchange, "status 200")
    (finding,) = judge.evidence["http/x"].findings.values()
    assert len(finding.operations) == 200
    assert (finding.seen, finding.operations["OPTIONS /7"].seen) == (201, 2)
    assert "and 189 more." in finding.text
    assert len(finding.text) < 1000


def test_two_server_errors_of_one_operation_are_two_findings():
    judge = Judge({"http/x"})
    for said in (b"KeyError", b"TypeError"):
        judge.check("http/x", False, Exchange(_GET, Response(500, (), said, 1.0)), "status 200")
    assert len(judge.evidence["http/x"].findings) == 2


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
