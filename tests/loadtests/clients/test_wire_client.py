"""The wire client against servers that do everything that HTTP allows, and some of what it does not."""

import socket
import threading
import time

import gevent
import pytest
import requests
from urllib3 import Retry

from loadtests.clients.endpoint import Endpoint, EndpointError, tls_context
from loadtests.clients.failures import CallError
from loadtests.clients.library import LibraryRest, Sent, new_session
from loadtests.clients.payloads import rest_request
from loadtests.clients.robot import Robot
from loadtests.clients.wire import Connection, Request


def get(endpoint, path="/robot/pose/"):
    return Request(f"GET {endpoint.path}{path} HTTP/1.1\r\nHost: {endpoint.authority}\r\n\r\n".encode(), b'"pose"')


def connect(toy, timeout=60.0, tls=None):
    return Connection(Endpoint.parse(toy.url), timeout, tls)


@pytest.mark.parametrize("form", ["", "chunked", "gzip", "old"])
def test_answers_are_read_in_every_framing(toy, form):
    connection = connect(toy("--form", form))
    for _ in range(3):
        answer = connection.call(get(connection.endpoint))
        assert answer.status == 200
        assert b'"covariance"' in answer.body
        assert answer.body.endswith(b"}")
        assert form == "gzip" or answer.octets > len(answer.body)
        assert answer.headers[b"server-timing"] == b"app;dur=0.015"
    assert connection.connects == (3 if form == "old" else 1), "a connection is kept wherever the robot keeps it"


@pytest.mark.parametrize(("form", "kind"), [("garbage", "malformed"), ("cut", "closed"), ("drip", "timeout")])
def test_what_is_no_answer_is_an_error_of_its_kind(toy, form, kind):
    connection = connect(toy("--form", form), timeout=0.6 if kind == "timeout" else 30)
    begun = time.monotonic()
    with pytest.raises(CallError) as caught:
        connection.call(get(connection.endpoint))
    assert caught.value.kind == kind
    assert time.monotonic() - begun < 30


def test_a_request_is_never_sent_twice(toy):
    robot = toy()
    connection = connect(robot)
    connection.call(get(connection.endpoint))
    with pytest.raises(CallError) as caught:
        connection.call(get(connection.endpoint, "/hang-up"))
    assert caught.value.kind == "closed"
    count = connection.call(get(connection.endpoint, "/count"))
    assert count.body == b"3", "the robot saw the pose, the request that it hung up on, and this one"
    assert connection.connects == 2


def test_an_idle_connection_that_the_robot_closed_is_opened_anew_without_an_error(toy):
    connection = connect(toy("--idle", "0.2"))
    for busy in (False, True):
        connection.call(get(connection.endpoint))
        (time.sleep if busy else gevent.sleep)(0.8)  # with the loop running, and with the loop held up
    connection.call(get(connection.endpoint))
    assert connection.connects == 3


def test_the_deadline_holds_while_a_robot_says_nothing(toy):
    connection = connect(toy("--delay", "30"), timeout=0.3)
    with pytest.raises(CallError, match=r"within 0\.3 s"):
        connection.call(get(connection.endpoint))


def test_nobody_listens(toy):
    robot = toy()
    robot.process.kill()
    robot.process.wait()
    with pytest.raises(CallError) as caught:
        connect(robot).call(get(Endpoint.parse(robot.url)))
    assert caught.value.kind == "refused"


def test_a_host_that_takes_no_connection():
    with socket.socket() as full:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        address = full.getsockname()
        waiting = [socket.socket() for _ in range(4)]
        for one in waiting:  # fill the queue of connections that nobody accepts: further ones get no answer
            one.setblocking(False)
            one.connect_ex(address)
        endpoint = Endpoint("http", *address, "")
        with pytest.raises(CallError, match="no connection within the deadline") as caught:
            Connection(endpoint, 0.3).call(get(endpoint))
        assert caught.value.kind == "network"
        with pytest.raises(CallError, match="no connection within the deadline") as caught:
            LibraryRest(Robot(endpoint.url, None, None, timeout_s=0.3), Sent()).call("pose", {})
        assert caught.value.kind == "network"
        for one in waiting:
            one.close()


def test_a_name_that_does_not_resolve():
    endpoint = Endpoint.parse("http://robot.invalid:1")
    with pytest.raises(CallError) as caught:
        Connection(endpoint, 5).call(get(endpoint))
    assert caught.value.kind in {"resolve", "network"}


def test_tls_with_the_robots_certificate_and_without(toy, certificate):
    robot = toy("--tls", *certificate)
    trusting = connect(robot, tls=tls_context(certificate[0]))
    for _ in range(3):
        assert trusting.call(get(trusting.endpoint)).status == 200
    assert trusting.connects == 1
    with pytest.raises(CallError, match="certificate") as caught:
        connect(robot, tls=tls_context(None)).call(get(trusting.endpoint))
    assert caught.value.kind == "tls"


def test_https_to_a_port_that_speaks_http(toy):
    robot = toy()
    endpoint = Endpoint.parse(robot.url.replace("http://", "https://"))
    with pytest.raises(CallError) as caught:
        Connection(endpoint, 2, tls_context(None)).call(get(endpoint))
    assert caught.value.kind in {"tls", "network"}


def test_ipv6_and_a_base_path(toy):
    robot = toy("--prefix", "/fleet/7", host="::1")
    connection = connect(robot)
    assert connection.endpoint.authority == f"[::1]:{robot.port}"
    assert connection.call(rest_request(connection.endpoint, "pose", {}, None)).status == 200
    assert connection.call(get(Endpoint.parse(f"http://[::1]:{robot.port}"))).status == 404


def test_a_server_that_floods_an_idle_connection_does_not_keep_the_loop_busy():
    listener = socket.create_server(("127.0.0.1", 0))

    def serve():
        peer, _ = listener.accept()
        peer.recv(1000)
        peer.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")
        time.sleep(0.1)
        peer.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n")
        peer.close()

    thread = threading.Thread(target=serve)
    thread.start()
    endpoint = Endpoint("http", "127.0.0.1", listener.getsockname()[1], "")
    connection = Connection(endpoint, 5)
    assert connection.call(get(endpoint)).status == 204
    thread.join()
    before = time.process_time()
    gevent.sleep(0.5)
    assert time.process_time() - before < 0.3
    listener.close()
    with pytest.raises(CallError, match="refused"):
        connection.call(get(endpoint))


@pytest.mark.parametrize(
    "url",
    [
        "robot:7003",
        "ftp://robot",
        *(f"http://{rest}" for rest in ("", "robot:99999", "robot:x", "me:secret@robot", "a b/")),
    ],
)
def test_urls_that_are_none(url):
    with pytest.raises(EndpointError) as caught:
        Endpoint.parse(url)
    assert "secret" not in str(caught.value)


def test_a_library_that_sends_again_by_itself_is_found_out(toy):
    robot = toy()
    sent = Sent()
    session = new_session(Robot(robot.url, None, None), sent)
    with pytest.raises(requests.ConnectionError):
        session.get(f"{robot.url}/hang-up", timeout=60)
    assert sent.requests == 1, "requests as it comes sends once"
    session.get_adapter(robot.url).max_retries = Retry(total=2, backoff_factor=0)
    with pytest.raises(requests.ConnectionError):
        session.get(f"{robot.url}/hang-up", timeout=60)
    assert sent.requests == 4, "and what retries below the call is counted all the same"
    assert session.get(f"{robot.url}/count", timeout=60).text == "5"
