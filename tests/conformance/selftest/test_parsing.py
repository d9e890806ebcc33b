"""What is HTTP is read, in whatever pieces it comes; what is not stays as it came."""

import pytest

from proof.mutation.wire import RequestParser, ResponseParser

PUT = b"PUT /p HTTP/1.1\r\nHost: a\r\nX-Two:  b \r\nContent-Length: 3\r\n\r\nabc"
CHUNKED = b"PUT /p HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n"
FINE = b"HTTP/1.1 200 OK\r\nContent-Length: 3\r\n\r\nabc"


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_a_request_is_read_in_pieces_of_any_size(size):
    parser = RequestParser("rest")
    found = [parser.feed(PUT[at : at + size]) for at in range(0, len(PUT), size)]
    assert found[:-1] == [None] * (len(found) - 1)
    assert (found[-1].method, found[-1].target, found[-1].body) == ("PUT", "/p", b"abc")
    assert found[-1].fields == [("Host", "a"), ("X-Two", "b"), ("Content-Length", "3")]


def test_chunks_are_put_together():
    assert RequestParser("rest").feed(CHUNKED + b"2\r\nab\r\n1;x=y\r\nc\r\n0\r\n\r\n").body == b"abc"


@pytest.mark.parametrize(
    "octets",
    [
        b"GARBAGE\r\n",
        b"GARBAGE\r\n\r\n",
        b"GET / HTTP/x.y\r\nHost: a\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nno field\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nX: \x00\r\n\r\n",
        b"PUT / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nabc",
        b"PUT / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: sealed\r\n\r\n",
        CHUNKED + b"zz\r\nabc\r\n",
    ],
)
def test_what_is_no_http_stays_as_it_came(octets):
    request = RequestParser("rest").feed(octets)
    assert (request.raw, request.octets(), request.method) == (octets, octets, "")


def test_a_response_is_read_past_informational_ones():
    parser = ResponseParser("GET")
    assert parser.feed(b"HTTP/1.1 100 Continue\r\n\r\n" + FINE[:20]) is None
    response = parser.feed(FINE[20:])
    assert (response.status, response.reason, response.body, response.method) == (200, "OK", b"abc", "GET")


def test_head_has_no_body_whatever_its_length():
    assert ResponseParser("HEAD").feed(FINE.removesuffix(b"abc")).body == b""


def test_a_body_without_length_ends_with_the_connection():
    parser = ResponseParser("GET")
    assert parser.feed(b"HTTP/1.0 200 OK\r\n\r\nab") is None
    assert parser.feed(b"c") is None
    assert parser.feed(b"").body == b"abc"
