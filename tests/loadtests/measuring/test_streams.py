"""Streams: messages are taken as they come, stamps of all kinds are read, and what goes wrong is said."""

import json
import threading
import time

import pytest
from jsonpath import JSONPointer
from websockets.sync.server import serve

from loadtests.clients.described import Described, Stream
from loadtests.clients.robot import Robot
from loadtests.measuring.streams import listen, stamp_s
from loadtests.statistics.streams import stream_figures


def robot_at(port):
    octets = f"GET /state HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()
    url = f"http://127.0.0.1:{port}"
    state = Described("GET /state", "GET", url, (octets,), ((200, ("application/json",)),))
    return Robot(url, None, None, timeout_s=2.0, described=(state,))


def events(port, path="/events"):
    octets = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()
    return Stream(f"GET {path}", "sse", f"http://127.0.0.1:{port}", octets)


def test_events_and_polls_come_with_their_age(started):
    _, port = started("toy_api.py", "--events", "100")
    heard, polled = listen(robot_at(port), [events(port)], "GET /state", "/stamp", 0.6, 200.0, lambda: False)
    assert (heard.kind, heard.error, polled.kind, polled.error) == ("sse", None, "polling", None)
    assert len(heard.ages_ms) == len(heard.moments_ns) > 10
    assert 3 < len(polled.ages_ms) < 14
    assert all(-1 < age < 500 for age in heard.ages_ms + polled.ages_ms), "one clock"


def test_messages_of_a_websocket_come_with_their_age():
    def send(client):
        for _ in range(20):
            client.send(json.dumps({"header": {"stamp": {"sec": int(time.time()), "nanosec": 0}}}))
        client.recv(timeout=5)

    with serve(send, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        port = server.socket.getsockname()[1]
        stream = Stream("state", "websocket", f"ws://127.0.0.1:{port}/ws")
        heard = listen(robot_at(port), [stream], None, "/header/stamp", 0.5, None, lambda: False)[0]
        server.shutdown()
    assert heard.error is None
    assert len(heard.moments_ns) == 20
    assert all(-1 < age < 2500 for age in heard.ages_ms)


def test_what_is_no_stream_is_said(started, free_port):
    _, port = started("toy_api.py")
    sources = [events(port, "/state"), events(free_port), Stream("ws", "websocket", f"ws://127.0.0.1:{port}/state")]
    errors = [one.error for one in listen(robot_at(port), sources, None, None, 5.0, None, lambda: False)]
    assert errors[0] == "it is application/json, no event stream"
    assert "connection refused" in errors[1]
    assert "it does not speak WebSocket" in errors[2]


@pytest.mark.parametrize("value", [1.5, "1.5", "1970-01-01T00:00:01.5Z", {"sec": 1, "nanosec": 500_000_000}])
def test_stamps_are_read(value):
    assert stamp_s(json.dumps({"a": [{"t": value}]}).encode(), JSONPointer("/a/0/t")) == pytest.approx(1.5)


@pytest.mark.parametrize(("unit", "seconds"), [(1, 1.7e9), (1e3, 1.7e9), (1e6, 1.7e9), (1e9, 1.7e9)])
def test_the_unit_of_a_number_is_known_by_its_size(unit, seconds):
    assert stamp_s(json.dumps(seconds * unit).encode(), JSONPointer("")) == pytest.approx(seconds)


@pytest.mark.parametrize("message", [b"{}", b"no JSON", b'{"t": null}', b'{"t": "soon"}', b'{"t": {}}'])
def test_a_message_without_a_stamp_has_no_age(message):
    assert stamp_s(message, JSONPointer("/t")) is None


def test_figures_of_a_stream_with_a_gap():
    moments = [at * 10_000_000 for at in (0, 1, 2, 3, 8, 9)]
    found = stream_figures(moments, [1.0, 2.0, 3.0], 0.1)
    assert found["rate"] == pytest.approx(5 / 0.09)
    assert found["interval_ms"] == {"min": 10.0, "p50": 10.0, "p90": None, "p99": None, "max": 50.0}
    assert found["gaps"] == {"longer_than_ms": 20.0, "count": 1}
    assert found["jitter_ms"] == pytest.approx(17.888, abs=0.001)
    assert found["age_ms"]["max"] == 3.0
    assert stream_figures([], [], 0.0)["interval_ms"] is None
