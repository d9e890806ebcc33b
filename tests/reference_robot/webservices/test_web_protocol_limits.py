"""What one client, or all together, may use of the HTTP server: sizes, times, connections, memory."""

import asyncio
import ssl

import pytest
from web_certificate import pair
from web_protocol import BIG, PATIENCE, TIMEOUT, closed, request, runs, statuses, until

from reference_robot.webservices.http.messages import BODY_LIMIT
from reference_robot.webservices.http.server import server_context


@pytest.mark.parametrize("declared", [True, False])
@runs()
async def test_content_over_the_limit_is_refused_dropped_and_the_connection_goes_on(robot, declared):
    body = b"x" * (BODY_LIMIT + 1)
    head = request(method="PUT", body=body) if declared else b""
    if not declared:
        head = request("/now", "Transfer-Encoding: chunked", method="PUT")
        head += b"%x\r\n%b\r\n0\r\n\r\n" % (len(body), body)
    assert statuses(await robot.ask(head + request("/now?next"))) == [413, 200]
    assert (robot.interface.seen, robot.port.held.size) == ([("GET", b"/now", b"")], 0)


@runs()
async def test_refused_content_without_end_is_not_read_for_ever(robot):
    _, writer = await robot.connect()
    writer.write(request("/now", "Transfer-Encoding: chunked", method="PUT"))
    with pytest.raises(ConnectionError):
        await send_for_ever(writer, b"10000\r\n" + b"x" * 0x10000 + b"\r\n")
    assert robot.port.held.size == 0


async def send_for_ever(writer, octets):
    while True:
        writer.write(octets)
        await writer.drain()


@pytest.mark.parametrize(
    ("between", "status"), [(b"", []), (b"\r\n", []), (b"\n\r\n", []), (b"GET", [408]), (b"GET / HTTP/1.1\r\n", [408])]
)
@runs(keep_alive=PATIENCE)
async def test_whatever_is_left_half_done_after_an_answer_runs_out_of_time(robot, between, status):
    async with robot.talk(request()) as (reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        writer.write(between)
        assert statuses(await closed(reader)) == status


UPGRADE = ("Connection: Upgrade", "Upgrade: h2c", "Content-Length: 900")
SLOW = {
    "a head": (b"GET /now?", [408]),
    "content": (request("/now", "Content-Length: 900", method="PUT"), [408]),
    "content after an offer to upgrade": (request("/now", *UPGRADE, method="PUT"), [408]),
    "content that is refused": (request("/closed", "Content-Length: 900", method="PUT"), [401]),
    "the next head in the same segment": (request() + b"GET /now?", [200, 408]),
}


@pytest.mark.parametrize("more", [b"", b"x"], ids=["silent", "slow"])
@pytest.mark.parametrize(("first", "expected"), SLOW.values(), ids=SLOW)
@runs(keep_alive=10 * TIMEOUT)
async def test_the_time_for_a_request_begins_with_its_first_segment(robot, first, expected, more):
    async with robot.talk(request()) as (reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        writer.write(first)
        ended = asyncio.create_task(closed(reader))
        while not ended.done():
            writer.write(more)
            await asyncio.sleep(0.05)
        assert statuses(await ended) == expected


@runs()
async def test_a_client_that_sends_nothing_or_only_line_ends_is_closed(robot):
    for octets in (b"", b"\r\n", b"\n\n"):
        async with robot.talk(octets) as (reader, _):
            assert await closed(reader) == b""


@runs()
async def test_a_client_that_asks_and_never_reads_is_dropped(robot):
    for asked in (request("/big") * 50, request("/big", "Connection: close")):
        reader, writer = await robot.connect()
        writer.transport.pause_reading()
        writer.write(asked)
        await until(lambda: robot.interface.seen)
        await robot.port.is_empty.wait()
        writer.transport.resume_reading()
        with pytest.raises(ConnectionResetError):  # and so the kernel, too, keeps nothing for it
            await reader.read()
        assert len(robot.interface.seen) < 5  # nothing is answered while nobody reads
        robot.interface.seen.clear()
        writer.close()


@runs()
async def test_a_slow_reader_gets_everything(robot):
    async with robot.talk(request("/big") * 3 + request("/now?end", "Connection: close")) as (reader, _):
        answer = await closed(reader)
        assert statuses(answer) == [200] * 4
        assert len(answer) > 3 * len(BIG)


@runs(connections=2)
async def test_connections_beyond_the_cap_are_told_so(robot):
    kept = [await robot.connect() for _ in range(2)]
    for _, writer in kept:
        writer.write(request())
    for reader, _ in kept:
        assert statuses(await reader.readuntil(b"\r\n\r\n")) == [200]
    reader, writer = await robot.connect()
    answer = await closed(reader)
    assert statuses(answer) == [503]
    assert b"retry-after: 1" in answer
    for _, each in [*kept, (reader, writer)]:
        each.close()


HALF = request("/now", "Content-Length: 900", method="PUT") + b"x" * 800
KEPT = {
    "content": HALF,
    "a head": b"GET /now HTTP/1.1\r\nX: " + b"x" * 3000,
    "many fields": b"GET /now HTTP/1.1\r\n" + b"a:b\r\n" * 20,
    "a head without its content": request("/now", "Content-Length: 5", "X: " + "x" * 3000, method="PUT"),
    "what is worked on": request("/later", "X: " + "x" * 3000),
    "what waits": request("/later") + request("/now") * 10,
}


@pytest.mark.parametrize("octets", KEPT.values(), ids=KEPT)
@runs(held=1000)
async def test_whatever_clients_make_the_robot_keep_is_bounded_for_all_and_given_back(robot, octets):
    _, holding = await robot.connect()
    holding.transport.pause_reading()
    holding.write(octets)
    await until(lambda: robot.port.is_full_for(1))
    assert statuses(await robot.ask(request(method="PUT", body=b"y" * 300))) == [503]
    holding.transport.abort()
    robot.interface.let_go.set()
    await until(lambda: robot.port.held.size == 0)
    assert statuses(await robot.ask(request(method="PUT", body=b"y" * 300))) == [200]
    assert robot.port.held.size == 0


@runs(held=1000)
async def test_a_client_that_does_not_read_is_dropped_at_once_where_too_much_is_kept(robot):
    reader, writer = await robot.connect()
    writer.transport.pause_reading()
    writer.write(request("/big"))
    await until(lambda: robot.interface.seen and not robot.port.held.size)
    writer.transport.resume_reading()
    assert len(await closed(reader)) < len(BIG)
    writer.close()


def test_tls_that_is_never_agreed_on_ends_and_counts_as_a_connection(tmp_path):
    certificate, key = pair(tmp_path, "robot")
    trusted = ssl.create_default_context(cafile=str(certificate))

    @runs(tls=server_context(certificate, key), connections=2)
    async def judged(robot):
        for octets in (b"", b"\x16\x03\x01", request()):
            async with robot.talk(octets) as (reader, _):
                assert b"HTTP" not in await closed(reader)
        silent = [await robot.connect() for _ in range(2)]
        third = await robot.connect(ssl=trusted)  # takes the place of the one that has waited longest
        assert await closed(silent[0][0]) == b""
        for _, writer in (*silent, third):
            writer.close()

        # And where it is: whoever is refused in the middle of a request can read why; half a goodbye is one.
        async with robot.talk(b"GET /" + b"x" * 9000, ssl=trusted) as (reader, _):
            assert statuses(await closed(reader)) == [414]
        async with robot.talk(request("/later"), ssl=trusted) as (reader, _):
            await until(lambda: robot.interface.seen)
        await robot.port.is_empty.wait()

    judged()
