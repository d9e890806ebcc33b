"""The HTTP connection by itself, in front of an interface that a test steers: requests, their order, ends."""

import asyncio
import os
import re
import time

import pytest
from web_protocol import closed, request, runs, statuses, until

from reference_robot.webservices.http.connection import HttpConnection


@runs()
async def test_what_waits_does_not_let_later_requests_overtake(robot):
    octets = b"".join(map(request, ("/now?1", "/later", "/now?2", "/broken", "/now?3")))
    async with robot.talk(octets) as (reader, _):
        assert b"1" in await reader.readuntil(b"\r\n\r\n1")
        assert [path for _, path, _ in robot.interface.seen] == [b"/now", b"/later"]
        robot.interface.let_go.set()
        answer = await reader.readuntil(b"\r\n\r\n3")
        assert statuses(answer) == [200, 200, 500, 200]
        assert answer.index(b"later") < answer.index(b"\r\n\r\n2")


@runs()
async def test_many_requests_in_one_segment_and_one_request_in_many_segments(robot):
    assert statuses(await robot.ask(request() * 1000)) == [200] * 1000
    reader, writer = await robot.connect()
    octets = request() + request(method="PUT", body=b"abc")
    for octet in octets:
        writer.write(bytes([octet]))
        await asyncio.sleep(0)
    assert statuses(await reader.readuntil(b"abc"))[-1] == 200
    writer.close()


@runs()
async def test_a_split_method_of_a_pipelined_request_is_read_as_it_was_sent(robot):
    reader, writer = await robot.connect()
    two = request("/now?1") * 2
    cut = len(two) // 2 + 1
    writer.write(two[:cut])
    await reader.readuntil(b"\r\n\r\n1")
    writer.write(two[cut:])
    assert statuses(await reader.readuntil(b"\r\n\r\n1")) == [200]
    assert [method for method, _, _ in robot.interface.seen] == ["GET", "GET"]
    writer.close()


@runs()
async def test_chunks_of_one_octet_make_one_content_and_trailers_no_fields(robot):
    head = request("/now", "Transfer-Encoding: chunked", method="PUT")
    answer = await robot.ask(head + b"1\r\na\r\n" * 5000 + b"0\r\nHost: b\r\n\r\n" + request("/now?end"))
    assert statuses(answer) == [200, 200]
    assert (robot.interface.seen[0], robot.port.held.size) == (("PUT", b"/now", b"a" * 5000), 0)


@runs()
async def test_a_head_that_says_enough_is_answered_before_its_content(robot):
    octets = request("/closed", "Content-Length: 10", "Expect: 100-continue", method="PUT")
    async with robot.talk(octets) as (reader, _):
        assert statuses(await reader.readuntil(b"\r\n\r\n")) == [401]


@runs()
async def test_a_client_that_expects_100_is_told_so_once(robot):
    octets = request("/now", "Content-Length: 3", "Expect: 100-Continue", method="PUT")
    async with robot.talk(octets) as (reader, writer):
        assert await reader.readuntil(b"\r\n\r\n") == b"HTTP/1.1 100 Continue\r\n\r\n"
        writer.write(b"abc")
        assert statuses(await reader.readuntil(b"abc")) == [200]


@runs()
async def test_the_last_request_of_a_connection_is_the_last(robot):
    for last in (request("/now", "Connection: close"), b"GET /now HTTP/1.0\r\n\r\n"):
        robot.interface.seen.clear()
        async with robot.talk(last + request("/now?more")) as (reader, _):
            answer = await closed(reader)
            assert statuses(answer) == [200]
            assert b"connection: close" in answer
            assert len(robot.interface.seen) == 1


@runs()
async def test_a_client_that_has_ended_its_side_still_gets_every_answer(robot):
    asked = asyncio.create_task(robot.ask(request("/later") + request("/now?2")))
    await until(lambda: robot.interface.seen)
    robot.interface.let_go.set()
    assert statuses(await asked) == [200, 200]


@runs()
async def test_stopping_finishes_what_is_under_way_and_closes_the_rest(robot):
    idle, idle_writer = await robot.connect()
    busy, busy_writer = await robot.connect()
    busy_writer.write(request("/later"))
    await until(lambda: robot.interface.seen)
    robot.port.stop()
    assert await closed(idle) == b""
    robot.interface.let_go.set()
    answer = await closed(busy)
    assert statuses(answer) == [200]
    assert b"connection: close" in answer
    idle_writer.close()
    busy_writer.close()


@pytest.mark.parametrize(
    ("target", "path", "query"),
    [
        ("/a?b=c?d", b"/a", b"b=c?d"),
        ("/a#b", b"/a", b""),
        ("//a/b", b"//a/b", b""),
        ("http://robot:80/a?b", b"/a", b"b"),
        ("http://robot", b"/", b""),
        ("*", b"*", b""),
    ],
)
@runs()
async def test_every_form_of_a_target_has_path_and_query(robot, target, path, query):
    answer = await robot.ask(request(target))
    assert statuses(answer) == [200]
    assert robot.interface.seen[0][1] == path
    assert answer.endswith(b"\r\n\r\n" + query)


@runs()
async def test_head_has_the_length_and_no_content_and_every_answer_a_date(robot):
    answer = await robot.ask(request("/now?four", method="HEAD"))
    assert b"content-length: 4\r\n" in answer
    assert answer.endswith(b"\r\n\r\n")
    assert re.search(rb"\r\ndate: \w{3}, \d\d \w{3} \d{4} [\d:]{8} GMT\r\n", answer)


@runs()
async def test_the_event_loop_polls_after_requests_that_follow_at_once_and_only_then(robot, monkeypatch):
    load = [0.0]
    monkeypatch.setattr(os, "getloadavg", lambda: (load[0], 0.0, 0.0))
    robot.port.tick()

    async def processor_time(began, answered):
        """Return the seconds of processor time that the event loop uses after a response, in 0.2 s."""
        robot.port.note_answer(began, answered)
        used = time.thread_time()
        await asyncio.sleep(0.2)
        return time.thread_time() - used

    now = time.perf_counter()
    assert await processor_time(now, now) < 0.01
    idle = await processor_time(now + 1, now + 2)  # a second after the last response
    assert idle < 0.01
    later = time.perf_counter() + 0.19  # polls until then, as far as other processes let it
    assert await processor_time(now + 2, later) > max(0.003, 5 * idle)
    assert await processor_time(later + 1, later + 1) < 0.01
    load[0] = 2.1 * os.cpu_count()
    robot.port.tick()
    later = time.perf_counter() + 0.1
    assert await processor_time(later, later) < 0.01, "polled on a crowded machine"


@runs()
async def test_the_attributes_of_a_connection_are_in_slots_which_saves_time_and_memory(robot):
    assert not hasattr(HttpConnection(robot.port), "__dict__")
