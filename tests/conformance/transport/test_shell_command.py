"""A finding's command, run by a shell, sends the request again as the suite sent it, octet by octet."""

import os
import shlex
import subprocess

import pytest

from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.credentials import Credential, Credentials, Kind
from conformance.transport.exchange import Request

_ALL = Credentials(
    (
        Credential(Kind.BEARER, "t0ken!x"),
        Credential(Kind.HEADER, "k3y$(id)\"'", "X-API-Key"),
        Credential(Kind.QUERY, "a&b", "key"),
    )
)
_SECRETS = {"ROAAS_TOKEN": "t0ken!x", "ROAAS_HEADER_X_API_KEY": "k3y$(id)\"'", "ROAAS_QUERY_KEY": "a%26b"}
# Fields that say which client sent a request.
_OF_THE_CLIENT = (b"user-agent:", b"connection:")


@pytest.fixture
def device(listening):
    """Record each request; gives the base URL and the list of them."""
    got = []

    def reply(connection):
        data, length = b"", 0
        while b"\r\n\r\n" not in data or len(data.split(b"\r\n\r\n", 1)[1]) < length:
            more = connection.recv(65536)
            if not more:
                break
            data += more
            head = data.split(b"\r\n\r\n", 1)[0].lower()
            length = int(head.split(b"content-length:")[1].split(b"\r\n")[0]) if b"content-length:" in head else 0
        got.append(data)
        connection.sendall(b"HTTP/1.1 204 No Content\r\nConnection: close\r\n\r\n")
        connection.close()

    return listening(reply), got


def _run(command, shell="sh"):
    assert "\n" not in command
    environment = {**os.environ, **_SECRETS}
    subprocess.run([shell, "-c", command], check=True, timeout=120, capture_output=True, env=environment)


def _shown(octets):
    head, _, body = octets.partition(b"\r\n\r\n")
    first, *fields = head.split(b"\r\n")
    return first, sorted(one.rstrip() for one in fields if not one.lower().startswith(_OF_THE_CLIENT)), body


@pytest.mark.parametrize("shell", ["sh", "bash"])
@pytest.mark.parametrize(
    ("method", "target", "headers", "body"),
    [
        ("GET", "/a/../b/./c?x=[1]&y={a,b}&z='e'", (), b""),
        ("GET", "/b%C3%BC%20c/%2e%2e/$HOME/`id`", (), b""),
        ("GET", "//twice//slashes", (("Accept", ""),), b""),
        ("GET", "/with-a-body", (("Content-Type", "application/json"),), b"{}"),
        ("HEAD", "/head", (), b""),
        ("HEAD", "/head-with-a-body", (), b"x"),
        ("OPTIONS", "/options", (("Origin", "http://a"),), b""),
        ("POST", "/empty", (), b""),
        ("DELETE", "/delete", (), b""),
        ("FOO", "/method", (), b""),
        ("PUT", "/empty-value", (("X-Empty", ""), ("X-Twice", "a"), ("X-Twice", "b")), b"1"),
        ("PUT", "/odd", (("X-Odd", 'it\'s "$HOME" `x` !! \\'), ("X-High", "\u00e9")), b"1"),
        ("PUT", "/encoding", (("Accept-Encoding", "gzip;q=0"),), b""),
        ("POST", "/no-type", (), b"a=b&c"),
        ("POST", "/lines", (("Content-Type", "text/xml"),), b"<a>\n\t<b c='d'>\\n $x %s</b>\n\n</a>\n"),
        ("POST", "/crlf", (), b"a\r\nb\r\n"),
        ("POST", "/file", (), b"@/etc/hostname"),
        ("POST", "/binary", (), bytes(range(256))),
        ("POST", "/letters", (), "\u00fc\ufeff\u4e2d".encode()),
        ("POST", "/long", (), b"A" * 100_000),
        ("POST", "/long-plain", (), b"ab" * 1000),
    ],
)
def test_a_request_of_the_client(device, method, target, headers, body, shell):
    url, got = device
    client = HttpClient(url, Connection(credentials=_ALL))
    sent = client.send(method, target, headers=headers, body=body).request
    command = sent.curl()
    assert not any(secret in command for secret in _SECRETS.values())
    _run(command, shell)
    assert _shown(got[1]) == _shown(got[0])


@pytest.mark.parametrize("body", ["{'x': '$ROAAS_TOKEN'}", "$ROAAS_TOKEN\n'\\n", "\0$ROAAS_TOKEN", "\r$ROAAS_TOKEN"])
def test_a_variable_in_a_body_is_its_value(device, body):
    url, got = device
    _run(Request("POST", url + "/", (), body.encode()).curl())
    assert _shown(got[0])[2] == body.replace("$ROAAS_TOKEN", _SECRETS["ROAAS_TOKEN"]).encode()


@pytest.mark.parametrize(
    "octets",
    [
        b"OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\n",
        b"GET http://x/a#b HTTP/1.1\r\nHost:\r\nHost: y\r\n\r\n",
        b"GET /a HTTP/1.0\nX : 'a\"\0\xff\n\n\r\n\r\n",
        b"POST / HTTP/1.1\r\nAuthorization: Bearer $ROAAS_TOKEN\r\nContent-Length: 2\r\n\r\n\xff\0",
    ],
)
def test_a_request_written_by_hand(device, octets):
    url, got = device
    _run(Request("GET", url + "/", raw=octets).curl())
    assert got == [octets.replace(b"$ROAAS_TOKEN", b"t0ken!x")]


def test_a_raw_head_with_credentials(device):
    url, got = device
    client = HttpClient(url, Connection(credentials=_ALL))
    octets = raw.head(client, "GET", "/a", "X-More: yes")
    _run(raw.shown_request(client, octets).curl())
    assert got == [octets]


def test_what_curl_would_change_is_sent_by_python():
    for request in (Request("CONNECT", "http://h/"), Request("GET", "http://h/a#b"), Request("GET", "http://h/\u00fc")):
        assert shlex.split(request.curl())[0] == "python3"
