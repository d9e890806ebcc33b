import json

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from conformance.checkers.rest import RestCheckers
from conformance.contract.ledger import twins
from conformance.contract.pack import Contract
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered

BASE = "http://robot:7003/r2"
TWIST = {part: dict.fromkeys("xyz", 0.0) for part in ("linear", "angular")}
DATE = ("Date", "Fri, 20 Nov 2026 23:00:00 GMT")
VARY = ("Vary", "Accept")
JSON = ("Content-Type", "application/json")
PROBLEM = ("Content-Type", "application/problem+json")


def seen(method, path, status, headers=(), body=b"", *, sent=(("Accept", "*/*"),), content=b"", raw=None, problem=""):
    """Requirements that an observer finds not met in one exchange."""
    request = Request(method, BASE + path, (("Host", "robot:7003"), *sent), content, raw)
    if status is None:
        kind = NoAnswer.CLOSED if "closed" in problem else NoAnswer.MALFORMED
        return not_met(Unanswered(request, problem, kind))
    return not_met(Exchange(request, Response(status, tuple(headers), body, 1.0)))


def not_met(*attempts):
    """Requirements that are not met in some exchanges, one after another."""
    contract = Contract.load()
    judges = RestCheckers(contract, BASE)
    broken = {case.requirement for attempt in attempts for case in judges(attempt) if not case.holds}
    names = {**contract.ids_by_alias, **twins(contract.ledger)}
    return {names.get(id_, id_) for id_ in broken} & contract.ledger.keys()


def test_good_answers_raise_no_alarm():
    body = json.dumps({**TWIST, "more": 1}).encode()
    assert seen("GET", "/robot/velocity/", 200, [DATE, VARY, JSON], body) == set()
    assert seen("HEAD", "/robot/velocity/", 200, [DATE, VARY, JSON]) == set()
    assert seen("PUT", "/robot/velocity/", 200, [DATE], content=body) == set()
    assert seen("DELETE", "/robot/navigation/action/goal/", 200, [DATE]) == set()
    assert seen("OPTIONS", "/robot/velocity/", 204, [DATE]) == set()
    assert seen("GET", "/robot/velocity", 308, [DATE, ("Location", "/r2/robot/velocity/")]) == set()
    assert seen("GET", "/robot/velocity/", 401, [DATE, ("WWW-Authenticate", "Bearer")]) == set()
    assert seen("GET", "/robot/velocity/", 431, [DATE], sent=(("X-Long", "a" * 9000),)) == set()
    assert seen("GET", "/robot/pose/", 503, [PROBLEM, ("Retry-After", "1")], b'{"status": 503, "detail": "x"}') == set()
    assert seen("FOO", "/robot/pose/", 501) == set()
    assert seen("GET", "/robot//pose/", 301, [DATE, ("Location", "/robot/pose/")]) == set()
    assert seen("GET", "", 400, [("Content-Type", "text/plain")], b"?", raw=b"GARBAGE") == set()
    assert seen("PUT", "/robot/velocity/", None, problem="the server closed the connection without a response") == set()


def test_whoever_is_refused_for_want_of_credentials_is_told_which():
    assert seen("GET", "/robot/velocity/", 401, [DATE]) == {"http/authentication"}
    assert seen("PUT", "/robot/velocity/", 401, [DATE], content=b"{") == {"http/authentication"}


def read(status, *headers, sent=(), body=b""):
    """A read of one resource."""
    return Exchange(
        Request("GET", f"{BASE}/robot/velocity/", (("Host", "robot:7003"), *sent)),
        Response(status, (DATE, VARY, *headers), body, 1.0),
    )


@pytest.mark.parametrize(
    ("attempts", "holds"),
    [
        ([read(304, sent=[("If-None-Match", '"a"')])], False),
        ([read(304, ("ETag", '"a"'), sent=[("If-None-Match", '"a"')])], False),
        ([read(200, JSON, ("ETag", '"a"'), body=b"{}"), read(304, sent=[("If-None-Match", 'W/"a", "b"')])], True),
        ([read(200, JSON, ("ETag", '"a"'), body=b"{}"), read(304, sent=[("If-None-Match", '"b"')])], False),
        ([read(304, sent=[("If-None-Match", "*")])], True),
        ([read(304, sent=[("If-Modified-Since", DATE[1])])], False),
        ([read(200, ("Last-Modified", DATE[1])), read(304, sent=[("If-Modified-Since", DATE[1])])], True),
        ([read(304)], False),
    ],
)
def test_not_modified_is_for_whoever_has_a_current_copy(attempts, holds):
    assert ("http/preconditions" not in not_met(*attempts)) is holds


@pytest.mark.parametrize(
    ("attempt", "holds"),
    [
        (read(206, ("Content-Range", "bytes 0-3/300"), sent=[("Range", "bytes=0-3")], body=b"abcd"), True),
        (read(206, ("Content-Range", "bytes 0-3/300"), sent=[("Range", "bytes=0-3")], body=b"abcde"), False),
        (read(206, sent=[("Range", "bytes=0-3")], body=b"abcd"), False),
        (read(206, ("Content-Range", "bytes 0-3/300"), body=b"abcd"), False),
        (read(416, sent=[("Range", "bytes=900-")]), True),
    ],
)
def test_a_part_is_for_whoever_asked_for_it(attempt, holds):
    assert ("http/range" not in not_met(attempt)) is holds


@pytest.mark.parametrize(("path", "refuted"), [("1.5", True), ("north", False)])
def test_a_valid_request_is_not_refused_by_just_any_status(path, refuted):
    path = f"/robot/app/delivery/3/depot_x/1/depot_y/2/dest_x/3/dest_y/4/source_x/5/source_y/{path}"
    assert ("http/declared-status" in seen("PUT", path, 407, [DATE])) is refuted
    assert "http/declared-status" not in seen("PUT", path, 406, [DATE], sent=(("Accept", "image/png"),))


def test_a_server_s_answer_to_a_range_or_a_condition_is_its_own():
    part = [DATE, VARY, JSON, ("Content-Range", "bytes 0-3/300")]
    assert seen("GET", "/robot/velocity/", 206, part, b'{"li', sent=(("Range", "bytes=0-3"),)) == set()
    assert seen("GET", "/robot/velocity/", 304, [DATE], sent=(("If-None-Match", "*"),)) == set()
    assert "http/declared-status" in seen("GET", "/robot/velocity/", 206, part, b'{"li')
    assert "http/declared-status" in seen("GET", "/robot/velocity/", 304, [DATE])


@pytest.mark.parametrize(
    ("method", "path", "status", "body"),
    [
        ("FOO", "/robot/pose/", 400, b""),
        ("GET", "/robot//pose/", 404, b"<html>"),
        ("GET", "/elsewhere", 404, b"<html>"),
        ("GET", "/robot/pose/", 406, b""),
        ("PUT", "/robot/app/delivery/3%2F4/depot_x/1", 404, b"<html>"),
        ("PUT", "/robot/app/delivery/3%00/depot_x/1", 400, b"<html>"),
        ("PUT", "/robot/app/delivery/3;a=b/depot_x/1", 400, b"<html>"),
        ("GET", "/robot/navigation/service/plan?x=[1]&y=0", 400, b"<html>"),
        ("GET", "/robot/navigation/service/plan?x=%&y=0", 400, b"<html>"),
    ],
)
def test_what_a_server_answers_by_itself_need_not_be_a_problem(method, path, status, body):
    headers = [DATE, ("Content-Type", "text/html")] if body else [DATE]
    assert seen(method, path, status, headers, body, sent=(("Accept", "image/png"),)) == {"http/problem-type-server"}


@pytest.mark.parametrize(
    ("content", "expected"), [(b"{", {"http/no-server-error"}), (json.dumps(TWIST).encode(), {"http/declared-status"})]
)
def test_a_crash_is_judged_by_what_was_sent(content, expected):
    sent = (("Accept", "*/*"), ("Content-Type", "application/json; charset=utf-8"))
    assert seen("PUT", "/robot/velocity/", 500, [PROBLEM], b"{}", sent=sent, content=content) == expected


@pytest.mark.parametrize(("octets", "expected"), [(10 * 2**20, {"http/no-server-error"}), (10 * 2**20 + 1, set())])
def test_a_gateway_may_say_that_the_robot_closed_the_connection_on_too_much(octets, expected):
    sent = (("Accept", "*/*"), ("Content-Type", "application/json"))
    assert seen("PUT", "/robot/velocity/", 502, sent=sent, content=b"{" * octets) == expected


def test_what_went_elsewhere_is_nobody_s_affair():
    assert not not_met(Exchange(Request("GET", "http://robot:7003/r2d2/x"), Response(500, (), b"", 1.0)))


@pytest.mark.parametrize(
    ("status", "headers", "body", "expected"),
    [
        (200, [VARY, JSON], json.dumps(TWIST), {"http/date"}),
        (200, [DATE, JSON], json.dumps(TWIST), {"rest-formats/vary"}),
        (200, [DATE, VARY], json.dumps(TWIST), {"http/content-type", "http/declared-body"}),
        (200, [DATE, VARY, ("Content-Type", "text/html")], "<p>", {"http/declared-body"}),
        (200, [DATE, VARY, ("Content-Type", "application/json; a=b"), JSON], json.dumps(TWIST), {"http/field-once"}),
        (200, [DATE, VARY, JSON], '{"linear": {}}', {"http/declared-body"}),
        (200, [DATE, VARY, JSON], "", {"http/declared-body"}),
        (200, [DATE, VARY, JSON], json.dumps(TWIST).replace("0.0", "NaN"), {"http/json-finite", "http/declared-body"}),
        (200, [DATE, VARY, JSON], "\ufeff" + json.dumps(TWIST), {"http/json-finite", "http/declared-body"}),
        (
            200,
            [DATE, VARY, JSON],
            json.dumps(TWIST)[:-1] + ', "linear": 1}',
            {"http/json-unique-names", "http/declared-body"},
        ),
        (202, [DATE, VARY, JSON], json.dumps(TWIST), {"http/declared-status"}),
        (404, [DATE, PROBLEM], '{"status": 404, "detail": "x"}', {"http/declared-status"}),
        (500, [DATE, PROBLEM], '{"status": 500}', {"http/declared-status"}),
        (503, [DATE, PROBLEM], '{"status": 503, "detail": "x"}', {"http/declared-status"}),
    ],
)
def test_bad_answers_to_get(status, headers, body, expected):
    assert seen("GET", "/robot/velocity/", status, headers, body.encode()) == expected


@pytest.mark.parametrize(
    ("charset", "body", "expected"),
    [
        ("", "<x>\u00e9</x>".encode(), set()),
        ("; charset=UTF-8", b"\xef\xbb\xbf<x/>", set()),
        ("; charset=iso-8859-1", b"<x/>", set()),
        ("; charset=iso-8859-1", "<x>\u00e9</x>".encode(), {"rest-formats/charset"}),
        ("; charset=utf-16", b"<x/>", {"rest-formats/charset"}),
        ("; charset=no-such", b"<x/>", {"rest-formats/charset"}),
        ("", "<x>\u00e9</x>".encode("latin-1"), {"rest-formats/charset"}),
        ("; charset=iso-8859-1", "<x>\u00e9</x>".encode("latin-1"), set()),
        ("; charset=utf-16", "<x/>".encode("utf-16"), set()),
    ],
)
def test_the_charset_is_that_of_the_content(charset, body, expected):
    found = seen("GET", "/robot/velocity/", 200, [DATE, VARY, ("Content-Type", f"text/plain{charset}")], body)
    assert found & {"rest-formats/charset"} == expected


@pytest.mark.parametrize(
    ("content_type", "body", "expected"),
    [
        ("application/problem+xml; charset=utf-16", b"<problem/>", {"rest-formats/charset"}),
        ("application/problem+xml", b"<problem/>", set()),
        ("text/plain; charset=utf-16", b"no", {"rest-formats/charset"}),
        ("text/plain", "\u00e9".encode("latin-1"), set()),  # of a server in front, which names none
    ],
)
def test_the_charset_of_an_error_is_that_of_the_content(content_type, body, expected):
    found = seen("GET", "/robot/velocity/", 422, [DATE, VARY, ("Content-Type", content_type)], body)
    assert found & {"rest-formats/charset"} == expected


@pytest.mark.parametrize(
    ("headers", "body", "accept", "expected"),
    [
        ([DATE, ("Content-Type", "text/html")], "no", "*/*", {"http/problem-type"}),
        ([DATE, PROBLEM], '{"detail": "x"}', "*/*", {"http/problem-type"}),
        ([DATE, PROBLEM], '{"status": 400, "detail": "x"}', "*/*", {"http/problem-type"}),
        ([DATE, PROBLEM], '{"status": "422", "detail": "x"}', "*/*", {"http/problem-type"}),
        ([DATE, PROBLEM], '{"status": 422, "detail": "x"}', "application/xml", {"rest-formats/problem-xml"}),
        (
            [DATE, PROBLEM],
            '{"status": 422, "detail": "Traceback (most recent call last): ..."}',
            "*/*",
            {"http/no-traceback"},
        ),
        (
            [DATE, ("Content-Type", "application/problem+xml")],
            "<problem xmlns='urn:ietf:rfc:7807'><status>422</status></problem>",
            "application/xml",
            set(),
        ),
    ],
)
def test_problems(headers, body, accept, expected):
    path = "/robot/navigation/service/plan?x=abc&y=0"
    assert seen("GET", path, 422, headers, body.encode(), sent=(("Accept", accept),)) == expected


def test_formats_are_read_as_what_they_say_they_are():
    xml, text = [DATE, VARY, ("Content-Type", "application/xml")], [DATE, VARY, ("Content-Type", "text/plain")]
    wants_xml, wants_text = (("Accept", "application/xml"),), (("Accept", "text/plain"),)
    path = "/robot/velocity/linear/"
    assert seen("GET", path, 200, xml, b"<Vector3><x>1</x><y>2</y></Vector3>", sent=wants_xml) == {"rest-formats/xml"}
    assert seen("GET", path, 200, text, b"x: 1\ny: fast\nz: 0", sent=wants_text) == {"rest-formats/text"}
    assert seen("GET", path, 200, text, b"x: 1\ny: 1\nz: 0\n---\n", sent=wants_text) == set()
    assert seen("GET", path, 200, text, b"x: 1\ny: 1\nz: 0", sent=wants_xml) == {"http/not-acceptable"}


@pytest.mark.parametrize(
    ("name", "value", "holds"),
    [
        ("DATE", " Sun, 06 Nov 1994 08:49:37 GMT ", True),
        ("Date", "Sun, 06 Nov 1994 08:49:37 -0000", False),
        ("Date", "Sun, 6 Nov 1994 08:49:37 GMT", False),
        ("Date", "Sunday, 06-Nov-94 08:49:37 GMT", False),
        ("Date", "Sun Nov  6 08:49:37 1994", False),
        ("last-modified", "Sun, 06 Nov 1994 08:49:37 GMT", True),
        ("Last-Modified", "Sun, 06 Nov 1994 08:49:37 UTC", False),
        ("Expires", "0", True),
        ("Retry-After", "1", True),
    ],
)
def test_the_format_of_a_time(name, value, holds):
    found = seen("OPTIONS", "/robot/velocity/", 204, [(name, value)])
    assert ("http/date-format" in found) is not holds


@pytest.mark.parametrize(("at", "holds"), [("22:00:00", True), ("23:00:59", True), ("23:02:00", False)])
def test_nothing_is_changed_after_its_response(at, holds):
    found = seen("OPTIONS", "/robot/velocity/", 204, [DATE, ("Last-Modified", f"Fri, 20 Nov 2026 {at} GMT")])
    assert ("http/last-modified" in found) is not holds


@pytest.mark.parametrize(
    ("value", "holds"),
    [
        ('"a1"', True),
        ('W/"a1"', True),
        ('""', True),
        (' "a,\\ü" ', True),
        ("a1", False),
        ("'a1'", False),
        ('w/"a1"', False),
        ('W/ "a1"', False),
        ('"a 1"', False),
        ('"a"1"', False),
        ('"a", "b"', False),
        ("*", False),
        ("", False),
    ],
)
def test_the_format_of_an_entity_tag(value, holds):
    found = seen("OPTIONS", "/robot/velocity/", 204, [("etag", value)])
    assert ("http/etag-format" in found) is not holds


def test_garbage_is_bad_framing():
    found = seen("GET", "/robot/pose/", None, problem="a response that is not HTTP: illegal status line")
    assert found == {"http/framing"}


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.sampled_from(["/robot/pose/", "/robot/sensors/", "/robot/navigation/action/goal/", "/no/such"]),
    st.sampled_from([200, 204, 301, 404, 422, 500, 503, 999]),
    st.sampled_from(
        ["application/json", "application/xml", "text/plain", "application/problem+json", "application/problem+xml", ""]
    ),
    st.one_of(
        st.binary(max_size=40),
        st.sampled_from([b"[" * 5000, b"<a>" * 300, b"- " * 3000, b"&a: [*a]", b"[1, {}]", b"null", b'{"status": []}']),
        st.recursive(st.none() | st.floats() | st.text(), st.lists, max_leaves=5).map(
            lambda item: json.dumps(item).encode()
        ),
    ),
    st.text(max_size=5),
)
def test_no_answer_breaks_an_observer(path, status, media_type, body, date):
    seen("GET", path, status, [("Content-Type", media_type), ("Date", date)], body)


def _sent(method, path, status, body=b"[]"):
    answer = Response(status, (DATE, VARY, JSON, ("Allow", "GET")), b"" if method == "HEAD" else body, 1.0)
    return Exchange(Request(method, f"{BASE}{path}", (("Host", "robot:7003"),)), answer)


_SENSORS, _SERVICES = "/robot/sensors/", "/robot/navigation/services/"


@pytest.mark.parametrize(
    ("attempts", "expected"),
    [
        ([("GET", _SENSORS, 200), ("HEAD", _SENSORS, 200), ("GET", _SENSORS, 200)], set()),
        ([("GET", _SENSORS, 200), ("HEAD", _SENSORS, 206), ("GET", _SENSORS, 200)], {"http/head"}),
        ([("GET", _SENSORS, 200), ("POST", _SERVICES, 405), ("POST", _SENSORS, 404), ("GET", _SENSORS, 200)],
         {"http/method-not-allowed"}),
        ([("GET", _SENSORS, 200), ("POST", _SENSORS, 404), ("GET", _SENSORS, 200)], set()),
        ([("POST", _SERVICES, 405), ("POST", _SENSORS, 404), ("GET", _SENSORS, 404)], set()),
    ],
)  # fmt: skip
def test_checkers_with_memory_judge_a_robot_of_a_contract(attempts, expected):
    found = not_met(*(_sent(*one) for one in attempts))
    assert found & {"http/head", "http/method-not-allowed"} == expected
