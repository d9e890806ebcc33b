"""The proxy hands on what it gets, and alters only what its change alters."""

import http.client
import socket
import ssl
import time
from contextlib import closing, suppress
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from toy_server import serving

from proof.mutation.changes import altered, becomes, header, instead, plain, rest, rewritten, values
from proof.mutation.messages import HangUpError, Response
from proof.mutation.self_test import GoodDevice
from proof.selftest.controls import VARIANTS, certificate
from proof.selftest.proxy import Proxy
from proof.selftest.robots import Robot
from proof.table1.independent_robots.plain import serve as plain_robot


@pytest.fixture
def robot():
    """A robot that answers with what it was asked, and remembers."""
    robot = SimpleNamespace(seen=[])

    def answer(method, path, body):
        robot.seen.append((method, path, body))
        return 200, body if method != "GET" else b'{"x": 1, "at": "%s/here"}' % robot.url.encode()

    with serving(answer) as robot.url:
        yield robot


@pytest.fixture
def proxy(robot):
    with closing(Proxy(robot.url, robot.url + "/turtlesim_publisher_ws?wsdl")) as proxy:
        yield proxy


def request(url, method="GET", path="/robot/pose/", body=None, **headers):
    where = urlsplit(url)
    connection = http.client.HTTPConnection(where.hostname, where.port, timeout=30)
    try:
        connection.request(method, where.path + path, body, headers)
        response = connection.getresponse()
        return response, response.read()
    finally:
        connection.close()


def raw(url, octets):
    where = urlsplit(url)
    with socket.create_connection((where.hostname, where.port), timeout=30) as sock:
        sock.sendall(octets)
        sock.shutdown(socket.SHUT_WR)
        got = b""
        with suppress(ConnectionResetError):
            while data := sock.recv(65536):
                got += data
        return got


def test_it_hands_on_and_puts_its_own_address_in(proxy, robot):
    response, body = request(proxy.rest)
    assert response.status == 200
    assert f"{proxy.rest}/here".encode() in body
    assert robot.seen == [("GET", "/robot/pose/", b"")]
    assert request(proxy.rest, "PUT", body=b"abc")[1] == b"abc"


def test_chunked_requests_are_handed_on(proxy, robot):
    where = urlsplit(proxy.rest)
    head = f"PUT /p HTTP/1.1\r\nHost: {where.netloc}\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\n"
    # The robot of this test reads no chunks; what arrives is the proxy's affair.
    raw(proxy.rest, head.encode() + b"3\r\nabc\r\n2\r\nde\r\n0\r\n\r\n")
    assert robot.seen[0][:2] == ("PUT", "/p")


def test_answers_are_altered_where_they_should_be(proxy):
    proxy.change = altered(rest("GET", "/robot/pose/"), values(lambda value: value.update(x=2)))()
    assert b'"x": 2' in request(proxy.rest)[1]
    assert b'"x": 1' in request(proxy.rest, path="/robot/other/")[1]


def test_every_nth_is_altered_and_no_other(proxy):
    proxy.change = altered(rest("GET"), becomes(502), nth=3)()
    assert [request(proxy.rest)[0].status for _ in range(7)] == [200, 200, 502, 200, 200, 502, 200]


def test_fields_and_requests_are_altered(proxy, robot):
    proxy.change = altered(rest("GET"), header("Content-Type", None))()
    assert "Content-Type" not in request(proxy.rest)[0].headers
    proxy.change = rewritten(rest("PUT"), lambda one: setattr(one, "body", b"other"))()
    assert request(proxy.rest, "PUT", body=b"abc")[1] == b"other"
    proxy.change = instead(rest("PUT"), plain(418))()
    assert request(proxy.rest, "PUT", body=b"abc")[0].status == 418
    assert [method for method, _, _ in robot.seen] == ["GET", "PUT"]


def test_hanging_up_answers_nothing(proxy):
    def change(_ask, _forward):
        raise HangUpError

    proxy.change = change
    with pytest.raises(http.client.RemoteDisconnected):
        request(proxy.rest)


def test_octets_can_be_sent_as_they_are(proxy):
    proxy.change = lambda one, _forward: Response(
        200, raw=b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\nshort", method=one.method
    )
    assert raw(proxy.rest, b"GET / HTTP/1.1\r\nHost: a\r\n\r\n").endswith(b"\r\n\r\nshort")


def test_what_is_no_http_reaches_the_robot():
    rest_url, soap_url, stop = plain_robot(0, 0)
    with closing(Proxy(rest_url, soap_url)) as proxy:
        assert b" 400 " in raw(proxy.rest, b"GARBAGE\r\n\r\n").split(b"\r\n")[0]
    stop()


def test_a_broken_change_is_told(proxy):
    proxy.change = lambda _ask, _forward: {}["nothing"]
    with pytest.raises(http.client.RemoteDisconnected):
        request(proxy.rest)
    assert proxy.broken[0].startswith("KeyError: 'nothing'")


def test_a_request_that_ends_in_the_middle_reaches_its_own_hook_and_no_robot(proxy, robot):
    came = []
    proxy.incomplete_request = lambda side, octets, _forward: came.append((side, octets))
    octets = b"PUT /p HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\nabc"
    raw(proxy.rest, octets)
    assert (came, robot.seen) == ([("rest", octets)], [])


def test_a_serial_robot_waits_for_the_request_before(proxy):
    proxy.serial = True
    where = urlsplit(proxy.rest)
    with socket.create_connection((where.hostname, where.port), timeout=30) as half:
        half.sendall(b"GET / HTTP/1.1\r\n")
        time.sleep(0.2)
        with socket.create_connection((where.hostname, where.port), timeout=0.5) as other:
            other.sendall(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
            with pytest.raises(TimeoutError):
                other.recv(1)


def test_a_prefix_is_taken_off(robot):
    with closing(Proxy(robot.url, robot.url, prefix="/r2d2/api")) as proxy:
        assert proxy.rest.endswith("/r2d2/api")
        assert request(proxy.rest)[0].status == 200
        assert robot.seen == [("GET", "/robot/pose/", b"")]
        assert request(proxy.rest.removesuffix("/r2d2/api"))[0].status == 404


def test_it_speaks_tls_with_a_certificate_of_its_own(robot, tmp_path):
    context, ca_file = certificate(tmp_path)
    with closing(Proxy(robot.url, robot.url, tls=context)) as proxy:
        where = urlsplit(proxy.rest)
        trust = ssl.create_default_context(cafile=str(ca_file))
        connection = http.client.HTTPSConnection(where.hostname, where.port, timeout=30, context=trust)
        connection.request("GET", "/")
        assert connection.getresponse().status == 200
        connection.close()


@pytest.mark.parametrize(
    ("name", "sent"),
    [
        ("token", {"Authorization": "Bearer open-sesame"}),
        ("basic", {"Authorization": "Basic cm9ib3Q6b3Blbi1zZXNhbWU="}),
        ("api-key", {"X-Api-Key": "open-sesame"}),
    ],
)
def test_variants_with_credentials_ask_as_rfc_9110_has_it(proxy, name, sent):
    variant = next(one for one in VARIANTS if one.name == name)
    proxy.change = variant.make()
    response, _ = request(proxy.rest)
    assert (response.status, "WWW-Authenticate" in response.headers) == (401, True)
    assert request(proxy.rest, **sent)[0].status == 200


def test_a_device_without_soap_has_a_proxy_without_it(robot):
    with closing(Proxy(robot.url)) as proxy:
        behind = proxy.before(Robot(Path("pack"), GoodDevice("lamp", lambda _: []), robot.url))
        assert (behind.rest, behind.publishers, list(proxy.listens)) == (proxy.rest, "", ["rest"])
        assert request(behind.rest)[0].status == 200


def test_wsdls_are_at_the_proxy_under_their_own_paths(proxy, robot):
    publishers = proxy.wsdl(f"{robot.url}/turtlesim_publisher_ws?wsdl")
    assert publishers.endswith("/turtlesim_publisher_ws?wsdl")
    assert not publishers.startswith(robot.url)
