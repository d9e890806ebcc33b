"""Clients that send half a request, vanish, or come in hundreds."""

import contextlib
import select
import socket
import threading
import time

from web_messages import delivery_envelope, delivery_path, twist

BODY = b'{"linear": {"x": 0.1, "y": 0, "z": 0},'
HALVES = {
    "nothing": b"",
    "half a method": b"PU",
    "half a target": b"GET /robot/po",
    "half a field": b"GET /robot/pose/ HTTP/1.1\r\nHost: ro",
    "no end of the head": b"GET /robot/pose/ HTTP/1.1\r\nHost: robot\r\n",
    "half a body": b"PUT /robot/velocity/ HTTP/1.1\r\nHost: robot\r\nContent-Type: application/json\r\n"
    b"Content-Length: 200\r\n\r\n" + BODY,
    "half a chunk": b"PUT /robot/velocity/ HTTP/1.1\r\nHost: robot\r\nContent-Type: application/json\r\n"
    b"Transfer-Encoding: chunked\r\n\r\n40\r\n" + BODY,
}


def test_half_a_request_is_given_up(served):
    with contextlib.ExitStack() as stack:
        waiting = {}
        for name, half in HALVES.items():
            for soap in (False, True):
                connection = stack.enter_context(served.connection(soap=soap))
                posted = half.replace(b"PUT /robot/velocity/", b"POST /turtlesim_publisher_ws")
                connection.sendall(posted.replace(b"application/json", b"text/xml") if soap else half)
                waiting[f"{name}, {'soap' if soap else 'rest'}"] = connection
        time.sleep(0.5)  # half of the deadline that the fixture sets
        assert [name for name, connection in waiting.items() if is_readable(connection)] == []
        for name, connection in waiting.items():
            connection.settimeout(60)
            answer = b""
            with contextlib.suppress(ConnectionResetError):
                while received := connection.recv(65536):
                    answer += received
            assert answer == b"" or answer.startswith(b"HTTP/1.1 408 "), name
    assert served.call("GET", "/robot/pose/").status_code == 200


def is_readable(connection: socket.socket) -> bool:
    return bool(select.select([connection], [], [], 0)[0])


def test_clients_that_vanish_leave_nothing_behind(served, foreign):
    for half in HALVES.values():
        for _ in range(5):
            with served.connection() as connection:
                connection.sendall(half)
    for _ in range(20):
        with served.connection() as connection:  # and does not wait for the answer
            connection.sendall(f"PUT {delivery_path()} HTTP/1.1\r\nHost: robot\r\n\r\n".encode())
    for _ in range(20):
        foreign.next("delivery")
    assert served.call("PUT", "/robot/velocity/", json=twist()).status_code == 200
    foreign.next("velocity")


def test_an_offer_of_http_2_is_ignored_and_the_content_read(served, foreign):
    """As Java's HttpClient sends its first request."""
    body = delivery_envelope().encode()
    answer = served.raw(
        b"POST /turtlesim_publisher_ws HTTP/1.1\r\nConnection: Upgrade, HTTP2-Settings, close\r\n"
        b"Content-Length: %d\r\nHost: robot\r\nHTTP2-Settings: AAEAAEAAAAIAAAABAAMAAABk\r\nUpgrade: h2c\r\n"
        b"Content-Type: text/xml\r\n\r\n%b" % (len(body), body),
        soap=True,
    )
    assert answer.startswith(b"HTTP/1.1 200 ")
    foreign.next("delivery")


def test_500_connections_at_once(served):
    request = b"GET /robot/pose/ HTTP/1.1\r\nHost: robot\r\nConnection: close\r\n\r\n"
    with contextlib.ExitStack() as stack:
        connections = [stack.enter_context(served.connection()) for _ in range(500)]
        for connection in connections:
            connection.settimeout(60)
            connection.sendall(request)
        assert all(connection.recv(100).startswith(b"HTTP/1.1 200 ") for connection in connections)


def test_many_clients_at_once_lose_nothing(served, foreign):
    def deliver() -> None:
        for _ in range(10):
            assert served.client.put(served.rest + delivery_path()).status_code == 204

    clients = [threading.Thread(target=deliver) for _ in range(10)]
    for client in clients:
        client.start()
    for client in clients:
        client.join()
    for _ in range(100):
        foreign.next("delivery")
    assert foreign.heard_nothing()
