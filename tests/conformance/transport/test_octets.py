"""What the suite's client sends, octet for octet, and that it takes each answer as it is, and tells it."""

import gzip
import re
import socket
from contextlib import closing

import pytest

from conformance.transport.client import Connection, HttpClient
from conformance.transport.codings import content_of
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered

_NOTHING = b"HTTP/1.1 204 No Content\r\n\r\n"


class _Recorder:
    """Keeps what comes in one piece, and answers each with the same octets."""

    def __init__(self, answer: bytes) -> None:
        self.answer = answer
        self.requests: list[bytes] = []

    def __call__(self, connection: socket.socket) -> None:
        while request := self._request(connection):
            self.requests.append(request)
            connection.sendall(self.answer)

    @staticmethod
    def _request(connection: socket.socket) -> bytes:
        """A whole request, or none when the connection has ended."""
        octets = b""
        while b"\r\n\r\n" not in octets:
            octets += (data := connection.recv(65_536))
            if not data:
                return b""
        head = octets.lower().partition(b"\r\n\r\n")[0]
        if b"transfer-encoding: chunked" in head:
            while not octets.endswith(b"0\r\n\r\n"):
                octets += connection.recv(65_536)
        elif found := re.search(rb"content-length: (\d+)", head):
            while len(octets) < len(head) + 4 + int(found[1]):
                octets += connection.recv(65_536)
        return octets


def _sent(listening, method: str, path: str, base: str = "", token: str | None = None, **options) -> bytes:
    """The octets of one request, with HOST for the address that differs from run to run."""
    recorder = _Recorder(_NOTHING)
    url = listening(recorder)
    with closing(HttpClient(url + base, Connection(token=token))) as client:
        exchange = client.send(method, path, **options)
    assert (exchange.response.status, exchange.request.url.endswith(base.rstrip("/") + path)) == (204, True)
    (octets,) = recorder.requests
    return octets.replace(url.removeprefix("http://").encode(), b"HOST")


@pytest.mark.parametrize(
    "target",
    [
        "/robot/pose",
        "//robot//pose",
        "/a/../b/./c",
        "/%zz%",
        "/%2e%2E/%c3%A9",
        "/a;b=c?x=+1&y=NaN&&z",
        "/?",
        "/#fragment",
        '/<script>"{}|\\^`[]',
        "*",
        "/" + "a" * 70_000,
        "http://elsewhere.example/",
    ],
)
def test_a_target_is_sent_as_it_is_given(listening, target):
    octets = _sent(listening, "GET", target, headers=[("Accept", "")])
    assert octets == f"GET {target} HTTP/1.1\r\nHost: HOST\r\n\r\n".encode()


@pytest.mark.parametrize(
    ("base", "path", "target"), [("", "", "/"), ("/", "", "/"), ("/r2d2/", "/x", "/r2d2/x"), ("/r2d2", "", "/r2d2")]
)
def test_the_base_path_goes_before_what_is_asked_for(listening, base, path, target):
    expected = f"GET {target} HTTP/1.1\r\nHost: HOST\r\nAccept: */*\r\n\r\n"
    assert _sent(listening, "GET", path, base=base) == expected.encode()


@pytest.mark.parametrize("method", ["get", "Put", "PROPFIND", "!#$%&'*+-.^_`|~", "HEAD", "OPTIONS", "DELETE"])
def test_a_method_is_any_token_in_its_own_letters(listening, method):
    assert _sent(listening, method, "/") == f"{method} / HTTP/1.1\r\nHost: HOST\r\nAccept: */*\r\n\r\n".encode()


@pytest.mark.parametrize("method", ["PUT", "POST", "PATCH"])
def test_a_body_has_its_length_even_when_it_is_empty(listening, method):
    start = f"{method} / HTTP/1.1\r\nHost: HOST\r\nAccept: */*\r\n"
    assert _sent(listening, method, "/") == f"{start}Content-Length: 0\r\n\r\n".encode()
    assert _sent(listening, method, "/", body=b"\x00\xff") == f"{start}Content-Length: 2\r\n\r\n".encode() + b"\x00\xff"


def test_fields_keep_their_order_their_letters_and_their_double(listening):
    fields = [("x-B", "1"), ("X-a", "é"), ("x-b", ""), ("Cookie", "c=d"), ("accept", "a/b;q=0, c/d"), ("X-a", "2")]
    expected = "GET / HTTP/1.1\r\nHost: HOST\r\nx-B: 1\r\nX-a: é\r\nx-b: \r\nCookie: c=d\r\n"
    expected += "accept: a/b;q=0, c/d\r\nX-a: 2\r\n\r\n"
    assert _sent(listening, "GET", "/", headers=fields) == expected.encode()


def test_what_the_caller_says_of_host_and_length_is_not_said_twice(listening):
    fields = [("hOST", "other.example"), ("content-length", "3")]
    assert _sent(listening, "PUT", "/", headers=fields, body=b"abc") == (
        b"PUT / HTTP/1.1\r\nhOST: other.example\r\ncontent-length: 3\r\nAccept: */*\r\n\r\nabc"
    )


def test_a_chunked_body_has_no_length(listening):
    octets = _sent(listening, "PUT", "/", headers=[("Transfer-Encoding", "chunked")], body=b"abc")
    start = b"PUT / HTTP/1.1\r\nHost: HOST\r\nTransfer-Encoding: chunked\r\nAccept: */*\r\n\r\n"
    assert octets == start + b"3\r\nabc\r\n0\r\n\r\n"


def test_the_token_and_the_end_of_a_fresh_connection_come_last(listening):
    token = "t"  # noqa: S105 - made up
    assert _sent(listening, "GET", "/", token=token, fresh=True) == (
        b"GET / HTTP/1.1\r\nHost: HOST\r\nAccept: */*\r\nConnection: close\r\nAuthorization: Bearer t\r\n\r\n"
    )
    assert b"Authorization" not in _sent(listening, "GET", "/", token=token, authorized=False)
    own = _sent(listening, "GET", "/", token=token, headers=[("authorization", "Basic eDp5")])
    assert own == b"GET / HTTP/1.1\r\nHost: HOST\r\nauthorization: Basic eDp5\r\nAccept: */*\r\n\r\n"


def test_the_environment_changes_nothing(listening, monkeypatch, tmp_path):
    (tmp_path / "netrc").write_text("default login a password b\n")
    monkeypatch.setenv("NETRC", str(tmp_path / "netrc"))
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9/")
    monkeypatch.setenv("ALL_PROXY", "http://127.0.0.1:9/")
    assert _sent(listening, "GET", "/") == b"GET / HTTP/1.1\r\nHost: HOST\r\nAccept: */*\r\n\r\n"


@pytest.mark.parametrize("location", [b"/elsewhere", b"http://[::1", b"http://%00/", b"\xff\xfe", b""])
def test_no_redirect_is_followed_and_none_hides_an_answer(listening, location):
    recorder = _Recorder(b"HTTP/1.1 302 Found\r\nLocation: " + location + b"\r\nContent-Length: 0\r\n\r\n")
    assert HttpClient(listening(recorder), Connection()).send("GET", "/").response.status == 302
    assert len(recorder.requests) == 1


def test_no_cookie_is_sent_back_and_no_content_is_decoded(listening):
    recorder = _Recorder(
        b"HTTP/1.1 200 OK\r\nSet-Cookie: c=d; Path=/\r\nContent-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc"
    )
    client = HttpClient(listening(recorder), Connection())
    for _ in range(2):
        assert client.send("GET", "/").response.body == b"abc"
    assert (len(set(recorder.requests)), len(recorder.requests)) == (1, 2)


@pytest.mark.parametrize("size", [0, 12_000])
def test_a_short_request_leaves_in_one_piece(listening, size):
    pieces = []

    def serve(connection: socket.socket) -> None:
        pieces.append(connection.recv(65_536))
        connection.sendall(_NOTHING)

    client = HttpClient(listening(serve), Connection())
    body = b"-" * size
    assert client.send("PUT", "/x", body=body).response.status == 204
    client.close()
    (piece,) = pieces
    assert piece.partition(b"\r\n\r\n")[2] == body


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
