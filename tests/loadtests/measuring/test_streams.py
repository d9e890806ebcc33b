"""Streams: messages are taken as they come, stamps of all kinds are read, and what goes wrong is said."""

import json
import threading
import time

import pytest
from jsonpath import JSONPointer
from websockets.sync.server import serve

from loadtests.clients.robot import Described, Robot, Stream
from loadtests.measuring.clocks import RobotClock, Stamp, stamp_of
from loadtests.measuring.streams import listen, stream_figures
from loadtests.settings.settings import Streams
from loadtests.statistics.recorder import SHARED, Offset


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
    heard, polled = listen(robot_at(port), Streams((events(port),), "/stamp"), "GET /state", 0.6, 200.0, lambda: False)
    assert (heard.kind, heard.error, polled.kind, polled.error) == ("sse", None, "polling", None)
    assert len(heard.ages_ms) == len(heard.moments_ns) > 10
    assert 3 < len(polled.ages_ms) < 14
    assert all(-1 < age < 500 for age in heard.ages_ms + polled.ages_ms), "one clock"


def test_messages_of_a_websocket_come_with_their_age():
    def send(client):
        for _ in range(20):
            client.send(json.dumps({"header": {"stamp": {"sec": int(time.time()), "nanosec": 0}}}))
        client.recv(timeout=60)

    with serve(send, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        port = server.socket.getsockname()[1]
        stream = Stream("state", "websocket", f"ws://127.0.0.1:{port}/ws")
        heard = listen(robot_at(port), Streams((stream,), "/header/stamp"), None, 0.5, None, lambda: False)[0]
        server.shutdown()
    assert heard.error is None
    assert len(heard.moments_ns) == 20
    assert all(-1 < age < 2500 for age in heard.ages_ms)


def test_what_is_no_stream_is_said(started, free_port):
    _, port = started("toy_api.py")
    sources = (events(port, "/state"), events(free_port), Stream("ws", "websocket", f"ws://127.0.0.1:{port}/state"))
    errors = [one.error for one in listen(robot_at(port), Streams(sources), None, 5.0, None, lambda: False)]
    assert errors[0] == "it is application/json, no event stream"
    assert "connection refused" in errors[1]
    assert "it does not speak WebSocket" in errors[2]


@pytest.mark.parametrize("value", [1.5, "1.5", "1970-01-01T00:00:01.5Z", {"sec": 1, "nanosec": 500_000_000}])
def test_stamps_are_read(value):
    found = stamp_of(json.dumps({"a": [{"t": value}]}).encode(), JSONPointer("/a/0/t"))
    assert found.seconds == pytest.approx(1.5)
    assert found.digit_s == (1e-6 if isinstance(value, dict) else 0.1)


@pytest.mark.parametrize(("unit", "seconds"), [(1, 1.7e9), (1e3, 1.7e9), (1e6, 1.7e9), (1e9, 1.7e9)])
def test_the_unit_of_a_number_is_known_by_its_size(unit, seconds):
    assert stamp_of(json.dumps(seconds * unit).encode(), JSONPointer("")).seconds == pytest.approx(seconds)


@pytest.mark.parametrize("message", [b"{}", b"no JSON", b'{"t": null}', b'{"t": "soon"}', b'{"t": {}}'])
def test_a_message_without_a_stamp_has_no_age(message):
    assert stamp_of(message, JSONPointer("/t")) is None


def test_figures_of_a_stream_with_a_gap():
    moments = [at * 10_000_000 for at in (0, 1, 2, 3, 8, 9)]
    found = stream_figures(moments, [1.0, 2.0, 3.0], 0.1, SHARED)
    assert found["rate"] == pytest.approx(5 / 0.09)
    assert found["interval_ms"] == {"min": 10.0, "p50": 10.0, "p90": None, "p99": None, "max": 50.0}
    assert found["gaps"] == {"longer_than_ms": 20.0, "count": 1}
    assert found["jitter_ms"] == pytest.approx(17.888, abs=0.001)
    assert (found["age_ms"]["max"], found["age_error_ms"]) == (3.0, 0.0)
    assert stream_figures([], [], 0.0, SHARED)["interval_ms"] is None


def test_ages_are_by_the_robots_clock_with_its_error_or_not_known():
    found = stream_figures([1, 2, 3], [1.0, 2.0, 3.0], 0.1, Offset(0.010, 0.014))
    assert (found["clock_offset_ms"], found["age_error_ms"]) == (12.0, 2.0)
    assert (found["age_ms"]["min"], found["age_ms"]["max"]) == (13.0, 15.0)
    unknown = stream_figures([1, 2, 3], [1.0, 2.0, 3.0], 0.1, None)
    assert [unknown[name] for name in ("clock_offset_ms", "age_ms", "age_error_ms", "stamped")] == [None, None, None, 3]


AHEAD_S = 100.0


@pytest.mark.parametrize(("told", "most_s"), [(None, 1.1), ("/now", 0.25)], ids=["by Date", "by a field"])
def test_the_robots_clock_is_bounded_by_its_responses(started, told, most_s):
    _, port = started("toy_api.py", "--ahead", str(AHEAD_S), "--age", "0.5")
    wanted = Streams((events(port),), "/stamp", told)
    heard, polled = listen(robot_at(port), wanted, "GET /state", 1.5, 200.0, lambda: False)
    assert heard.clock is polled.clock
    offset = polled.clock.offset
    assert offset.low_s <= AHEAD_S <= offset.high_s, "whatever the machine was busy with"
    assert offset.error_s < most_s
    old = stream_figures(polled.moments_ns, polled.ages_ms, 1.5, offset)
    assert old["age_ms"]["p50"] >= 500 - old["age_error_ms"]


def test_bounds_of_many_responses_are_narrower_than_those_of_each():
    clock = RobotClock()
    assert clock.offset is None
    clock.add_stamp(Stamp(100.0, 0.0), 10.0, 10.4)
    clock.add_stamp(Stamp(101.1, 0.0), 11.0, 11.2)
    assert clock.offset == pytest.approx((89.9, 90.0))
    clock.add_date(b"Thu, 01 Jan 1970 00:01:50 GMT", 20.9, 21.0)
    assert clock.offset == pytest.approx((89.9, 90.0)), "it lies between 89 and 91.1"
    clock.add_date(b"yesterday", 30.0, 30.1)
    clock.add_date(None, 30.0, 30.1)
    clock.data(Stamp(131.0, 1.0), 40.0)
    assert clock.offset == pytest.approx((90.0, 90.0)), "data is not from the future"
    clock.data(Stamp(140.0, 1.0), 40.0)
    assert clock.offset is None, "the bounds contradict one another"


def test_a_clock_without_a_bound_from_above_is_not_known():
    clock = RobotClock()
    clock.data(Stamp(100.0, 1e-6), 10.0)
    assert clock.offset is None


def test_topics_of_a_rosbridge_come_with_their_age(started, free_port):
    _, port = started("toy_rosbridge.py", "--hz", "100")
    url = f"ws://127.0.0.1:{port}"
    sources = (Stream("odom", "rosbridge", f"{url}#/odom"), Stream("silent", "rosbridge", f"{url}#/nothing"))
    heard, silent = listen(robot_at(free_port), Streams(sources, "/header/stamp"), None, 1.0, None, lambda: False)
    assert (heard.kind, heard.error, silent.error) == ("rosbridge", None, None)
    assert len(heard.ages_ms) == len(heard.moments_ns) > 10
    assert silent.moments_ns == []


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ('{"op": "status", "level": "error", "msg": "no such topic"}', 'rosbridge: "no such topic"'),
        ('{"topic": "/odom"}', "not a message of the rosbridge protocol"),
    ],
)
def test_what_a_rosbridge_refuses_is_said(answer, told, free_port):
    asked = []

    def refuse(client):
        asked.append(json.loads(client.recv(timeout=60)))
        client.send(answer)
        client.recv(timeout=60)

    with serve(refuse, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        stream = Stream("odom", "rosbridge", f"ws://127.0.0.1:{server.socket.getsockname()[1]}#/odom")
        heard = listen(robot_at(free_port), Streams((stream,)), None, 5.0, None, lambda: False)[0]
        server.shutdown()
    assert told in heard.error
    assert asked == [{"op": "subscribe", "id": "roaas", "topic": "/odom"}]
