"""Messages become the octets that they say, whatever a mutant made of them; a robot's addresses lead to the proxy."""

import pytest

from proof.mutation.messages import Request, Response
from proof.selftest.proxy import Addresses


def test_fields_are_found_in_any_case_and_altered_in_a_copy_alone():
    request = Request("rest", "GET", "/p?a=1", fields=[("Accept", "a/b"), ("X", "1")])
    copy = request.copy()
    copy.put("ACCEPT", "c/d")
    assert (request.field("accept"), copy.fields) == ("a/b", [("X", "1"), ("ACCEPT", "c/d")])
    assert (request.path, request.query) == ("/p", "a=1")


def test_a_length_fits_the_body():
    request = Request("rest", "PUT", "/", fields=[("Content-Length", "9")], body=b"abc")
    assert request.octets() == b"PUT / HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc"
    assert Request("rest", "GET", "/").octets() == b"GET / HTTP/1.1\r\n\r\n"
    assert Response(200, body=b"abc").octets() == b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc"


def test_a_request_keeps_contradicting_lengths():
    request = Request("rest", "PUT", "/", fields=[("Content-Length", "3"), ("Content-Length", "4")], body=b"abc")
    assert request.octets().count(b"Content-Length") == 2


@pytest.mark.parametrize(("body", "octets"), [(b"abc", b"3\r\nabc\r\n0\r\n\r\n"), (b"", b"0\r\n\r\n")])
def test_chunks_stay_chunks(body, octets):
    request = Request("rest", "PUT", "/", fields=[("Transfer-Encoding", "chunked")], body=body)
    assert request.octets().endswith(b"\r\n\r\n" + octets)


def test_where_no_body_may_be_there_is_none():
    assert Response(204, [("Content-Length", "3")], b"abc").octets() == b"HTTP/1.1 204 No Content\r\n\r\n"
    head = Response(200, [("Content-Length", "3")], b"abc", method="HEAD")
    assert head.octets() == b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\n"


@pytest.mark.parametrize(
    ("message", "last"),
    [
        (Response(200), False),
        (Response(200, [("connection", "Close")]), True),
        (Response(200, version="HTTP/1.0"), True),
        (Response(200, raw=b"x"), True),
        (Request("rest", "GET", "/"), False),
        (Request("rest", raw=b"x"), True),
    ],
)
def test_a_connection_ends_where_nobody_knows_how_it_goes_on(message, last):
    assert message.is_last is last


PLAIN = Addresses({"rest": "http://r:1", "soap": "http://r:2"}, {"rest": "http://p:3", "soap": "http://p:4"})
PREFIXED = Addresses(PLAIN.robot, PLAIN.proxy, "/api")


def test_addresses_in_bodies_and_fields_are_the_proxys():
    response = PLAIN.outward(Response(201, [("Location", "http://r:1/x")], b"http://r:1/a http://r:2/b"))
    assert (response.field("Location"), response.body) == ("http://p:3/x", b"http://p:3/a http://p:4/b")


def test_a_robot_that_goes_by_its_host_is_at_a_proxy_that_speaks_tls():
    behind_tls = Addresses(PLAIN.robot, {"rest": "https://p:3", "soap": "https://p:4"})
    response = behind_tls.outward(Response(200, [("Location", "http://p:3/x")], b"http://p:4/b http://r:2/c"))
    assert (response.field("Location"), response.body) == ("https://p:3/x", b"https://p:4/b https://p:4/c")


def test_a_prefix_is_taken_off_and_put_on():
    assert PREFIXED.inward(Request("rest", "GET", "/api/x")).target == "/x"
    assert PREFIXED.inward(Request("rest", "GET", "/x")) is None
    assert PREFIXED.inward(Request("rest", "GET", "http://p:3/api/x?y=http://z/")).target == "/x?y=http://z/"
    assert PREFIXED.inward(Request("rest", "GET", "http://p:3/x")) is None
    assert PREFIXED.outward(Response(201, [("Location", "/x")])).field("Location") == "/api/x"
    assert PREFIXED.public("rest") == "http://p:3/api"


def test_soap_and_what_is_no_http_know_no_prefix():
    soap, raw = Request("soap", "GET", "/x"), Request("rest", raw=b"x")
    assert (PREFIXED.inward(soap), PREFIXED.inward(raw)) == (soap, raw)
