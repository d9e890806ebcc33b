"""The HTTP connection by itself, in front of an interface that a test steers: order, limits, deadlines, ends."""

import asyncio
import functools
import itertools
import re
import ssl
from contextlib import asynccontextmanager

import pytest
import uvloop
from web_certificate import pair

from reference_robot.webservices.endpoint import bound
from reference_robot.webservices.http.admission import Admission
from reference_robot.webservices.http.authorization import Authorization
from reference_robot.webservices.http.hosts import AllowedHosts
from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.messages import BODY_LIMIT, content
from reference_robot.webservices.http.port import Limits, Port
from reference_robot.webservices.http.server import serve
from reference_robot.webservices.http.tls import server_context
from reference_robot.webservices.representation.problems import Problem

PATIENCE = 0.6
TIMEOUT = 20.0
BIG = b"x" * 16_000_000  # more than the kernel buffers on both sides (tcp_wmem and tcp_rmem)


class Steered(Interface):
    """Answers ``/now`` with the content, ``/later`` once it is let go, ``/big`` with megabytes, ``/broken`` never."""

    def __init__(self):
        super().__init__(Admission(Authorization(None), AllowedHosts("a")))
        self.seen = []
        self.let_go = asyncio.Event()

    def scope(self, request):
        raise NotImplementedError(request)  # nobody asks for a token

    def admit(self, request):
        if request.path == b"/closed":
            raise Problem(401, "closed")

    def answer(self, request):
        self.seen.append((request.method, request.path, request.body))
        if request.path == b"/broken":
            raise ValueError("on purpose")
        if request.path == b"/later":
            return self._later()
        return content(200, "text/plain", BIG if request.path == b"/big" else request.body or request.query)

    async def _later(self):
        await self.let_go.wait()
        return content(200, "text/plain", b"later")


class Served:
    def __init__(self, interface, port, address):
        self.interface, self.port, self._address = interface, port, address

    async def connect(self, **options):
        return await asyncio.open_connection(*self._address, **options)

    async def ask(self, octets):
        """Send octets and the end of them; return all that comes back."""
        reader, writer = await self.connect()
        writer.write(octets)
        writer.write_eof()
        answer = await asyncio.wait_for(reader.read(), TIMEOUT)
        writer.close()
        return answer


@asynccontextmanager
async def served(tls=None, **limits):
    interface, stop, started = Steered(), asyncio.Event(), asyncio.Event()
    port, listener = Port(interface, Limits(PATIENCE, **limits)), bound("127.0.0.1", 0)
    serving = asyncio.create_task(serve(port, listener, started, stop, tls))
    await started.wait()
    try:
        yield Served(interface, port, listener.getsockname())
    finally:
        stop.set()
        await asyncio.wait_for(serving, TIMEOUT)


def runs(test):
    """Run a test that is a coroutine function, on the event loop that the robot runs on."""

    @functools.wraps(test)
    def run(*arguments, **named):
        uvloop.run(asyncio.wait_for(test(*arguments, **named), TIMEOUT))

    return run


async def until(condition):
    """Wait for a condition; whoever waits in vain is ended by ``runs``."""
    for _ in itertools.count():
        if condition():
            return
        await asyncio.sleep(0.01)


def request(target="/now", *fields, method="GET", body=b""):
    length = [f"Content-Length: {len(body)}"] if body else []
    return "\r\n".join([f"{method} {target} HTTP/1.1", "Host: a", *fields, *length, "", ""]).encode() + body


def statuses(answer):
    return [int(status) for status in re.findall(rb"HTTP/1\.1 (\d+)", answer)]


async def closed(reader, within=TIMEOUT):
    """Return what still comes until the robot closes the connection."""
    try:
        return await asyncio.wait_for(reader.read(), within)
    except ConnectionResetError:
        return b""


@runs
async def test_what_waits_does_not_let_later_requests_overtake():
    async with served() as robot:
        reader, writer = await robot.connect()
        writer.write(request("/now?1") + request("/later") + request("/now?2") + request("/broken") + request("/now?3"))
        assert b"1" in await reader.readuntil(b"\r\n\r\n1")
        assert [path for _, path, _ in robot.interface.seen] == [b"/now", b"/later"]
        robot.interface.let_go.set()
        answer = await reader.readuntil(b"\r\n\r\n3")
        assert statuses(answer) == [200, 200, 500, 200]
        assert answer.index(b"later") < answer.index(b"\r\n\r\n2")
        writer.close()


@runs
async def test_many_requests_in_one_segment_and_one_request_in_many_segments():
    async with served() as robot:
        assert statuses(await robot.ask(request() * 1000)) == [200] * 1000
        reader, writer = await robot.connect()
        octets = request() + request(method="PUT", body=b"abc")
        for octet in octets:
            writer.write(bytes([octet]))
            await asyncio.sleep(0)
        assert statuses(await reader.readuntil(b"abc"))[-1] == 200
        writer.close()


@runs
async def test_a_split_method_of_a_pipelined_request_is_read_as_it_was_sent():
    async with served() as robot:
        reader, writer = await robot.connect()
        two = request("/now?1") * 2
        cut = len(two) // 2 + 1
        writer.write(two[:cut])
        await reader.readuntil(b"\r\n\r\n1")
        writer.write(two[cut:])
        assert statuses(await reader.readuntil(b"\r\n\r\n1")) == [200]
        assert [method for method, _, _ in robot.interface.seen] == ["GET", "GET"]
        writer.close()


@runs
async def test_chunks_of_one_octet_make_one_content_and_trailers_no_fields():
    async with served() as robot:
        head = request("/now", "Transfer-Encoding: chunked", method="PUT")
        answer = await robot.ask(head + b"1\r\na\r\n" * 5000 + b"0\r\nHost: b\r\n\r\n" + request("/now?end"))
        assert statuses(answer) == [200, 200]
        assert robot.interface.seen[0] == ("PUT", b"/now", b"a" * 5000)
        assert robot.port.held.octets == 0


@pytest.mark.parametrize("declared", [True, False])
@runs
async def test_content_over_the_limit_is_refused_dropped_and_the_connection_goes_on(declared):
    async with served() as robot:
        body = b"x" * (BODY_LIMIT + 1)
        head = request(method="PUT", body=body) if declared else b""
        if not declared:
            head = request("/now", "Transfer-Encoding: chunked", method="PUT") + b"%x\r\n%b\r\n0\r\n\r\n" % (
                len(body),
                body,
            )
        assert statuses(await robot.ask(head + request("/now?next"))) == [413, 200]
        assert robot.interface.seen == [("GET", b"/now", b"")]
        assert robot.port.held.octets == 0


@runs
async def test_refused_content_without_end_is_not_read_for_ever():
    async with served() as robot:
        _, writer = await robot.connect()
        writer.write(request("/now", "Transfer-Encoding: chunked", method="PUT"))
        with pytest.raises(ConnectionError):
            await send_for_ever(writer, b"10000\r\n" + b"x" * 0x10000 + b"\r\n")
        assert robot.port.held.octets == 0


async def send_for_ever(writer, octets):
    while True:
        writer.write(octets)
        await writer.drain()


@runs
async def test_a_head_that_says_enough_is_answered_before_its_content():
    async with served() as robot:
        reader, writer = await robot.connect()
        writer.write(request("/closed", "Content-Length: 10", "Expect: 100-continue", method="PUT"))
        assert statuses(await reader.readuntil(b"\r\n\r\n")) == [401]
        writer.close()


@runs
async def test_a_client_that_expects_100_is_told_so_once():
    async with served() as robot:
        reader, writer = await robot.connect()
        writer.write(request("/now", "Content-Length: 3", "Expect: 100-Continue", method="PUT"))
        assert await reader.readuntil(b"\r\n\r\n") == b"HTTP/1.1 100 Continue\r\n\r\n"
        writer.write(b"abc")
        assert statuses(await reader.readuntil(b"abc")) == [200]
        writer.close()


@runs
async def test_the_last_request_of_a_connection_is_the_last():
    async with served() as robot:
        for last in (request("/now", "Connection: close"), b"GET /now HTTP/1.0\r\n\r\n"):
            robot.interface.seen.clear()
            reader, writer = await robot.connect()
            writer.write(last + request("/now?more"))
            answer = await closed(reader)
            assert statuses(answer) == [200]
            assert b"connection: close" in answer
            assert len(robot.interface.seen) == 1
            writer.close()


@runs
async def test_a_client_that_has_ended_its_side_still_gets_every_answer():
    async with served() as robot:
        asked = asyncio.create_task(robot.ask(request("/later") + request("/now?2")))
        await until(lambda: robot.interface.seen)
        robot.interface.let_go.set()
        assert statuses(await asked) == [200, 200]


@pytest.mark.parametrize(
    ("between", "status"), [(b"", []), (b"\r\n", []), (b"\n\r\n", []), (b"GET", [408]), (b"GET / HTTP/1.1\r\n", [408])]
)
@runs
async def test_whatever_is_left_half_done_after_an_answer_runs_out_of_time(between, status):
    async with served(keep_alive=PATIENCE) as robot:
        reader, writer = await robot.connect()
        writer.write(request())
        await reader.readuntil(b"\r\n\r\n")
        writer.write(between)
        assert statuses(await closed(reader)) == status
        writer.close()


@runs
async def test_a_client_that_sends_nothing_or_only_line_ends_is_closed():
    async with served() as robot:
        for octets in (b"", b"\r\n", b"\n\n"):
            reader, writer = await robot.connect()
            writer.write(octets)
            assert await closed(reader) == b""
            writer.close()


@runs
async def test_a_client_that_asks_and_never_reads_is_dropped():
    async with served() as robot:
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


@runs
async def test_a_slow_reader_gets_everything():
    async with served() as robot:
        reader, writer = await robot.connect()
        writer.write(request("/big") * 3 + request("/now?end", "Connection: close"))
        answer = await closed(reader)
        assert statuses(answer) == [200] * 4
        assert len(answer) > 3 * len(BIG)
        writer.close()


@runs
async def test_connections_beyond_the_cap_are_told_so():
    async with served(connections=2) as robot:
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
@runs
async def test_whatever_clients_make_the_robot_keep_is_bounded_for_all_and_given_back(octets):
    async with served(held=1000) as robot:
        _, holding = await robot.connect()
        holding.transport.pause_reading()
        holding.write(octets)
        await until(robot.port.is_full)
        assert statuses(await robot.ask(request(method="PUT", body=b"y" * 300))) == [503]
        holding.transport.abort()
        robot.interface.let_go.set()
        await until(lambda: robot.port.held.octets == 0)
        assert statuses(await robot.ask(request(method="PUT", body=b"y" * 300))) == [200]
        assert robot.port.held.octets == 0


@runs
async def test_a_client_that_does_not_read_is_dropped_at_once_where_too_much_is_kept():
    async with served(held=1000) as robot:
        reader, writer = await robot.connect()
        writer.transport.pause_reading()
        writer.write(request("/big"))
        await until(lambda: robot.interface.seen and not robot.port.held.octets)
        writer.transport.resume_reading()
        assert len(await closed(reader)) < len(BIG)
        writer.close()


@runs
async def test_tls_that_is_never_agreed_on_ends_and_counts_as_a_connection(tmp_path):
    certificate, key = pair(tmp_path, "robot")
    trusted = ssl.create_default_context(cafile=str(certificate))
    async with served(tls=server_context(certificate, key), connections=2) as robot:
        for octets in (b"", b"\x16\x03\x01", request()):
            reader, writer = await robot.connect()
            writer.write(octets)
            assert b"HTTP" not in await closed(reader)
            writer.close()
        silent = [await robot.connect() for _ in range(2)]
        third, _ = await robot.connect()
        assert await closed(third, PATIENCE / 2) == b""
        for reader, writer in silent:
            await closed(reader)
            writer.close()

        # And where it is: whoever is refused in the middle of a request can read why; half a goodbye is one.
        reader, writer = await robot.connect(ssl=trusted)
        writer.write(b"GET /" + b"x" * 9000)
        assert statuses(await closed(reader)) == [414]
        writer.close()
        reader, writer = await robot.connect(ssl=trusted)
        writer.write(request("/later"))
        await until(lambda: robot.interface.seen)
        writer.close()
        await robot.port.is_empty.wait()


@runs
async def test_stopping_finishes_what_is_under_way_and_closes_the_rest():
    async with served() as robot:
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
@runs
async def test_every_form_of_a_target_has_path_and_query(target, path, query):
    async with served() as robot:
        answer = await robot.ask(request(target))
        assert statuses(answer) == [200]
        assert robot.interface.seen[0][1] == path
        assert answer.endswith(b"\r\n\r\n" + query)


@runs
async def test_head_has_the_length_and_no_content_and_every_answer_a_date():
    async with served() as robot:
        answer = await robot.ask(request("/now?four", method="HEAD"))
        assert b"content-length: 4\r\n" in answer
        assert answer.endswith(b"\r\n\r\n")
        assert re.search(rb"\r\ndate: \w{3}, \d\d \w{3} \d{4} [\d:]{8} GMT\r\n", answer)
