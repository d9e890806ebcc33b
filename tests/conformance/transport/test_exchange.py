"""What an exchange is told as, and what is in a content that is coded."""

import gzip

import pytest

from conformance.transport.codings import content_of
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered


def test_what_came_is_told_in_a_few_words():
    request = Request("GET", "http://127.0.0.1/")
    answer = Response(200, (("Content-Type", "Application/JSON; charset=utf-8"),), b"{}", 1.0)
    assert Exchange(request, answer).came == "status 200, application/json"
    assert Unanswered(request, "no response within 10 s", NoAnswer.TIMEOUT).came == "no response within 10 s"


def test_several_fields_of_one_name_are_one_list():
    assert Response(405, (("Allow", "GET"), ("allow", "PUT")), b"", 1.0).header("Allow") == "GET, PUT"


def test_the_size_of_a_request_by_hand_is_that_of_its_bytes():
    short, long = (Request("GET", "http://r2/", raw=octets) for octets in (b"GET /", b"GET / HTTP/1.1"))
    assert (short.size, long.size) == (5, 14)


@pytest.mark.parametrize(
    ("request_", "endpoint"),
    [
        (Request("GET", "http://r2:80/robot/app/3/x/-1.5?a=b"), "GET http://r2:80/robot/app/*/x/*"),
        (Request("GET", "http://r2/", raw=b"GET /robot/pose/ HTTP/1.1\r\n"), "GET http://r2/robot/pose/"),
        (Request("GET", "http://r2/", raw=b"GET http://r2/a?b HTTP/1.1\r\n"), "GET http://r2/a"),
        (Request("GET", "http://r2/", raw=b"\xff"), "GET http://r2"),
        (Request("POST", "http://r2/ws", body=b"<e:Body a='b'> <t:GetPose/></e:Body>"), "POST http://r2/ws GetPose"),
    ],
)
def test_requests_to_one_resource_have_one_endpoint(request_, endpoint):
    assert request_.endpoint == endpoint


def test_members_of_gzip_are_one_content_up_to_a_hundred():
    member = gzip.compress(b"a")
    assert content_of(member * 99, "gzip", is_whole=True).octets == b"a" * 99
    many = content_of(member * 100_000, "gzip", is_whole=True)  # each member copies what is left
    assert (many.is_plain, many.octets) == (False, member * 100_000)
