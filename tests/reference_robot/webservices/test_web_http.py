"""Methods, negotiation and errors, by RFC 9110 and 9457."""

import pytest
import yaml
from lxml import etree
from web_messages import delivery_path, twist
from web_robot import Served

ALLOWED = {
    "/robot/pose/": {"GET", "HEAD", "OPTIONS"},
    "/robot/velocity/": {"GET", "HEAD", "PUT", "OPTIONS"},
    "/robot/velocity/linear/": {"GET", "HEAD", "PUT", "OPTIONS"},
    "/robot/sensors/": {"GET", "HEAD", "OPTIONS"},
    "/robot/navigation/services/": {"GET", "HEAD", "OPTIONS"},
    "/robot/navigation/action/goal/": {"GET", "HEAD", "PUT", "DELETE", "OPTIONS"},
    "/robot/navigation/service/plan": {"GET", "HEAD", "OPTIONS"},
    "/robot/app/delivery/": {"GET", "HEAD", "OPTIONS"},
    delivery_path(): {"PUT", "OPTIONS"},
    "/openapi.json": {"GET", "HEAD", "OPTIONS"},
    "/application.wadl": {"GET", "HEAD", "OPTIONS"},
}
METHODS = {"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "PROPFIND", "BREW", "get"}


def fields(served: Served, path: str, method: str) -> tuple[int, dict[str, str]]:
    answer = served.raw(f"{method} {path} HTTP/1.1\r\nHost: robot\r\nConnection: close\r\n\r\n".encode())
    head = answer.partition(b"\r\n\r\n")[0].decode()
    status, *lines = head.split("\r\n")
    return int(status.split()[1]), dict(line.lower().split(": ", 1) for line in lines)


@pytest.mark.parametrize("path", ALLOWED)
def test_methods_that_are_not_offered_are_405_with_allow(served, path):
    for method in METHODS - ALLOWED[path]:
        status, answered = fields(served, path, method)
        assert status == 405
        assert {name.strip().upper() for name in answered["allow"].split(",")} == ALLOWED[path]
        assert answered["content-type"] == "application/problem+json"


@pytest.mark.parametrize("path", ALLOWED)
def test_options_tells_the_methods(served, path):
    answer = served.call("OPTIONS", path)
    assert (answer.status_code, answer.content) == (204, b"")
    assert set(answer.headers["Allow"].split(", ")) == ALLOWED[path]


@pytest.mark.parametrize("path", [path for path in ALLOWED if "GET" in ALLOWED[path] and "navigation" not in path])
def test_head_is_get_without_content(served, path):
    head, get = served.call("HEAD", path), served.call("GET", path)
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["Content-Type"] == get.headers["Content-Type"]


@pytest.mark.parametrize("method", ["GET", "PUT", "DELETE", "POST", "OPTIONS", "BREW"])
@pytest.mark.parametrize(
    "path",
    ["/", "/robot", "/robot/", "/robot/pose", "/robot/pose/x", "/robot//pose/", "/robot/app/delivery/4", "/%00", "/.."],
)
def test_unknown_paths_are_404_whatever_the_method(served, path, method):
    assert fields(served, path, method)[0] == 404


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        (None, "application/json"),
        ("*/*", "application/json"),
        ("", "application/json"),
        ("application/*", "application/json"),
        ("application/xml", "application/xml"),
        ("text/*", "text/plain"),
        ("application/json;q=0.5, application/xml;q=0.6", "application/xml"),
        ("application/json;q=0.5, application/xml;q=0.5", "application/json"),
        ("*/*;q=0.9, application/json;q=0.1", "application/xml"),
        ("application/json;q=0, */*", "application/xml"),
        ("application/*;q=0, */*;q=0.1", "text/plain"),
        ("TEXT/Plain ; q=1.000", "text/plain"),
        ("text/html, application/xhtml+xml, */*;q=0.1", "application/json"),
        ("application/json; charset=utf-8", "application/json"),
    ],
)
def test_accept_chooses_the_format(served, accept, media_type):
    answer = served.call("GET", "/robot/velocity/", headers={} if accept is None else {"Accept": accept})
    assert answer.status_code == 200
    assert answer.headers["Content-Type"].partition(";")[0] == media_type
    assert "accept" in answer.headers["Vary"].lower()


@pytest.mark.parametrize(
    "accept", ["image/png", "application/json;q=0", "*/*;q=0", "text/html", "application/json;q=zero", "nonsense"]
)
def test_nothing_acceptable_is_406(served, accept):
    for path in ("/robot/pose/", "/robot/sensors/", "/robot/app/delivery/", "/robot/navigation/action/goal/"):
        answer = served.call("GET", path, headers={"Accept": accept})
        assert answer.status_code == 406
        assert "accept" in answer.headers["Vary"].lower()


def test_several_accept_lines_are_one_list(served):
    lines = [("Accept", "text/html"), ("Accept", "application/xml")]
    assert served.call("GET", "/robot/pose/", headers=lines).headers["Content-Type"] == "application/xml"


def test_errors_are_problem_details_in_the_format_asked_for(served):
    answer = served.call("PUT", "/robot/velocity/", json=twist(x=9))
    assert answer.headers["Content-Type"] == "application/problem+json"
    assert answer.json() == {
        "type": "about:blank",
        "title": "Unprocessable Entity",
        "status": 422,
        "detail": "linear.x must lie within -0.7 and 0.7 m/s, not 9.0",
    }
    answer = served.call("PUT", "/robot/velocity/", json=twist(x=9), headers={"Accept": "application/xml"})
    assert answer.headers["Content-Type"] == "application/problem+xml"
    problem = etree.fromstring(answer.content)
    assert (problem.tag, problem.findtext("{urn:ietf:rfc:7807}status")) == ("{urn:ietf:rfc:7807}problem", "422")


@pytest.mark.parametrize("url", ["rest", "publishers"])
def test_every_answer_is_dated_and_timed(served, url):
    for answer in (served.client.get(getattr(served, url)), served.client.options(served.publishers)):
        assert answer.headers["Date"].endswith("GMT")
        assert float(answer.headers["Server-Timing"].removeprefix("app;dur=")) >= 0


def test_lists_have_an_element_for_each_entry(served):
    served.call("PUT", delivery_path())
    xml = etree.fromstring(served.call("GET", "/robot/app/delivery/", headers={"Accept": "application/xml"}).content)
    assert (xml.tag, {child.tag for child in xml}) == ("Deliveries", {"delivery"})
    text = served.call("GET", "/robot/app/delivery/", headers={"Accept": "text/plain"}).text
    assert yaml.safe_load(text) == served.call("GET", "/robot/app/delivery/").json()


@pytest.mark.parametrize(
    ("request_head", "status"),
    [
        (b"GET /robot/pose/ HTTP/1.1\r\nConnection: close\r\n\r\n", 400),
        (b"GET /robot/pose/ HTTP/1.1\r\nHost: a\r\nHost: b\r\nConnection: close\r\n\r\n", 400),
        (b"GET /robot/pose/ HTTP/1.0\r\n\r\n", 200),
        (b"GET http://robot/robot/pose/ HTTP/1.1\r\nHost: robot\r\nConnection: close\r\n\r\n", 200),
        (b"GET /robot/pose/ HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nab", 400),
        (b"PUT /robot/velocity/ HTTP/1.1\r\nHost: a\r\nContent-Length: -5\r\n\r\n", 400),
        (b"PUT /robot/velocity/ HTTP/1.1\r\nHost: a\r\nContent-Length: 99999999999999999999\r\n\r\n", 400),
        (b"PUT /robot/velocity/ HTTP/1.1\r\nHost: a\r\nContent-Length: 3000000\r\nConnection: close\r\n\r\n", 413),
        (b"NONSENSE\r\n\r\n", 400),
        (b"GET /robot/pose/ HTTP/9.9\r\nHost: a\r\n\r\n", 400),
        (b"GET /robot/p\xc3\xa4se/ HTTP/1.1\r\nHost: a\r\n\r\n", 400),
        (b"GET /robot/pose/ HTTP/1.1\r\nHost: a\r\nX: " + b"x" * 131072 + b"\r\n\r\n", 431),
        (b"GET /" + b"x" * 8001 + b" HTTP/1.1\r\nHost: a\r\n\r\n", 414),
        (b"GET /" + b"x" * 100_000 + b" HTTP/1.1\r\nHost: a\r\n\r\n", 414),
        (b"GET /" + b"x" * 7900 + b" HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n", 404),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 400),
    ],
)
def test_requests_that_are_no_good_http(served, request_head, status):
    answer = served.raw(request_head)
    assert answer.startswith(b"HTTP/1.1 %d " % status)
    assert status < 400 or b"application/problem+json" in answer
    assert b"Traceback" not in answer
    assert served.call("GET", "/robot/pose/").status_code == 200


def test_a_body_over_the_limit_is_413_and_one_of_64_kib_is_read(served):
    spaces = " " * (2 * 1024 * 1024)
    fields = {"Content-Type": "application/json"}
    assert served.call("PUT", "/robot/velocity/", content=spaces, headers=fields).status_code == 413
    pieces = (piece.encode() for piece in [" " * 65536] * 20)  # chunked: no length is told beforehand
    assert served.call("PUT", "/robot/velocity/", content=pieces, headers=fields).status_code == 413
    assert served.call("PUT", "/robot/velocity/", content=" " * 65536 + "7", headers=fields).status_code == 422
    assert served.soap(" " * (2 * 1024 * 1024)).status_code == 413


def test_descriptions_carry_the_address_by_which_they_were_asked_for(served):
    assert served.call("GET", "/openapi.json").json()["servers"] == [{"url": served.rest}]
    named = served.call("GET", "/openapi.json", headers={"Host": "robot.example:81"}).json()
    assert named["servers"] == [{"url": "http://robot.example:81"}]
    wadl = etree.fromstring(served.call("GET", "/application.wadl").content)
    assert wadl.find("{*}resources").get("base") == served.rest + "/"
