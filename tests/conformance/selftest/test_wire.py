"""Connections are read request by request, in whatever pieces; kept, opened again, and given up."""

import socket

import pytest

from proof.mutation.messages import Request, Response
from proof.mutation.wire import ClientConnection, IncompleteMessageError, RequestParser, ResponseParser, RobotConnection

OK = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok"
GET = Request("rest", "GET", "/", fields=[("Host", "a")])


@pytest.fixture
def pair():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.settimeout(60)
        theirs.settimeout(60)
        yield ClientConnection(ours, "rest"), theirs


@pytest.fixture
def robot(listening):
    """A connection to a robot that does with each of its sockets what a function does."""
    opened = []

    def serve(handle):
        url = listening(handle)
        opened.append(RobotConnection("127.0.0.1", int(url.rpartition(":")[2])))
        return opened[-1]

    yield serve
    for one in opened:
        one.close()


def test_pipelined_requests_come_one_by_one(pair):
    client, sock = pair
    sock.sendall(b"GET /1 HTTP/1.1\r\nHost: a\r\n\r\nGET /2 HTTP/1.1\r\nHost: a\r\n\r\n")
    sock.shutdown(socket.SHUT_WR)
    assert [client.request().target, client.request().target, client.request()] == ["/1", "/2", None]


def test_a_client_that_waits_is_told_to_go_on(pair):
    client, sock = pair
    sock.sendall(b"PUT / HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nContent-Length: 1\r\n\r\n")
    sock.shutdown(socket.SHUT_WR)
    with pytest.raises(IncompleteMessageError):
        client.request()
    assert sock.recv(100) == b"HTTP/1.1 100 Continue\r\n\r\n"


def test_the_last_response_ends_the_connection(pair):
    client, sock = pair
    client.respond(Response(204), last=False)
    sock.shutdown(socket.SHUT_WR)
    client.respond(Response(204), last=True)
    assert b"".join(iter(lambda: sock.recv(100), b"")).count(b"204 No Content") == 2


def test_a_connection_is_kept(robot):
    opened = []

    def handle(sock):
        opened.append(sock)
        while sock.recv(1000):
            sock.sendall(OK)

    connection = robot(handle)
    assert [connection.exchange(GET).body for _ in range(2)] == [b"ok", b"ok"]
    assert len(opened) == 1


def test_a_kept_connection_that_was_closed_is_opened_again(robot):
    def handle(sock):
        sock.recv(1000)
        sock.sendall(OK)
        sock.close()

    connection = robot(handle)
    assert [connection.exchange(GET).body for _ in range(2)] == [b"ok", b"ok"]


@pytest.mark.parametrize("octets", [b"", OK[:-1], b"garbage\r\n\r\n"])
def test_no_response_is_an_error(robot, octets):
    def handle(sock):
        sock.recv(1000)
        sock.sendall(octets)
        sock.close()

    with pytest.raises(IncompleteMessageError):
        robot(handle).exchange(GET)


def test_a_robot_may_answer_in_the_middle_of_a_large_body(robot):
    def handle(sock):
        sock.recv(1000)
        sock.sendall(OK)

    large = Request("rest", "PUT", "/", fields=[("Host", "a")], body=b"x" * 50_000_000)
    assert robot(handle).exchange(large).body == b"ok"


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
