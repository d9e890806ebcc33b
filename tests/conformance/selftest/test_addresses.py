"""A robot's own addresses lead to the proxy."""

from conformance.mutation.messages import Request, Response
from conformance.selftest.addresses import Addresses

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
