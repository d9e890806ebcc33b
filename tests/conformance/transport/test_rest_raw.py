import pytest

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError
from conformance.transport.raw import FramingError, chunked, head, parse, talk


def test_two_answers_in_one_stream():
    first, rest = parse(
        b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\n\r\nokHTTP/1.1 404 \r\ncontent-length: 0\r\n\r\n", "GET", closed=True
    )
    second, rest = parse(rest, "GET", closed=True)
    assert (first.status, first.body, second.status, rest) == (200, b"ok", 404, b"")


def test_chunks_and_trailer():
    response, rest = parse(
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2;a=b\r\nok\r\n3\r\nay!\r\n0\r\nX: y\r\n\r\n",
        "GET",
        closed=False,
    )
    assert (response.body, rest) == (b"okay!", b"")


def test_an_answer_to_head_has_no_body_whatever_its_length_says():
    assert parse(b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\n", "HEAD", closed=True)[1] == b""
    assert parse(b"HTTP/1.0 200 OK\r\nContent-Length: 5\r\n\r\nhello", "HEAD", closed=True)[1] == b"hello"


def test_an_interim_response_comes_before_the_final_one():
    octets = b"HTTP/1.1 103 Early Hints\r\nLink: </x>\r\n\r\nHTTP/1.1 204 No Content\r\nX-A: b\r\n\r\nrest"
    response, rest = parse(octets, "PUT", closed=False)
    assert (response.status, response.headers, rest) == (204, (("X-A", "b"),), b"rest")


def test_a_body_may_end_with_the_connection():
    assert parse(b"HTTP/1.0 200 OK\r\n\r\nall of it", "GET", closed=True)[0].body == b"all of it"


@pytest.mark.parametrize(
    "octets",
    [
        b"",
        b"ROBOT 200\r\n\r\n",
        b"HTTP/2 200 OK\r\n\r\n",
        b"HTTP/1.1 20 OK\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nno field\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nA : b\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nab",
        b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nabcdef",
        b"HTTP/1.1 200 OK\r\nContent-Length: -1\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n5\r\nab\r\n0\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nxyz\r\n",
        b"HTTP/1.1 200 OK\nContent-Length: 0\n\n",
        b"HTTP/1.1 200 OK\r\nA: b\nContent-Length: 0\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nA: b\r\n c\r\nContent-Length: 0\r\n\r\n",
        b"HTTP/2.0 200 OK\r\nContent-Length: 0\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: identity\r\n\r\nab",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab0\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nab\r\n0\r\n\n",
        b"HTTP/1.1 103 Early\nA: b\n\r\n\r\nHTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n",
    ],
)
def test_what_is_not_well_framed(octets):
    with pytest.raises(FramingError):
        parse(octets, "GET", closed=True)


def test_talk_reads_until_the_answer_is_whole(listening):
    def handle(connection):
        connection.recv(1000)
        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n")
        connection.sendall(b"ok")
        connection.recv(1000)

    client = HttpClient(listening(handle) + "/base", Connection(timeout_s=60, token="secret"))  # noqa: S106 - a test's
    octets = head(client, "GET", "/a", "X: y")
    assert octets.startswith(b"GET /base/a HTTP/1.1\r\nHost: 127.0.0.1:")
    assert b"Bearer secret" in octets
    came = talk(client, octets, answers=1)
    assert (came.closed, came.octets[-2:]) == (False, b"ok")


def test_talk_waits_before_it_sends_the_rest(listening):
    heard = []

    def handle(connection):
        heard.append(connection.recv(1000))
        connection.sendall(b"HTTP/1.1 100 Continue\r\n\r\n")
        heard.append(connection.recv(1000))
        connection.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")
        connection.recv(1000)

    client = HttpClient(listening(handle), Connection(timeout_s=60))
    came = talk(client, b"head" + b"content", answers=1, cuts=(4,), pause_s=5.0)
    assert (heard, came.early, parse(came.octets, "PUT", closed=False)[0].status) == ([b"head", b"content"], True, 204)


def test_talk_goes_on_where_nothing_comes(listening):
    client = HttpClient(listening(lambda connection: connection.recv(10) and connection.recv(1000)), Connection())
    came = talk(client, b"xyz", timeout_s=0.4, cuts=(1, 2), pause_s=0.01)
    assert (came.octets, came.early, came.sent_all) == (b"", False, True)


def test_chunks_with_extensions_and_trailers():
    assert chunked(b"hello", 3, b";a=1", b"X: y\r\n") == b"3;a=1\r\nhel\r\n2;a=1\r\nlo\r\n0;a=1\r\nX: y\r\n\r\n"


def test_talk_has_a_deadline(listening):
    client = HttpClient(listening(lambda connection: connection.recv(10) and connection.recv(1000)), Connection())
    came = talk(client, b"x", timeout_s=0.2)
    assert (came.octets, came.closed) == (b"", False)
    assert came.elapsed_ms < 20_000


def test_talk_with_nobody(closed_port):
    with pytest.raises(NoAnswerError):
        talk(HttpClient(closed_port, Connection(timeout_s=2)), b"x")
