"""The HTTP server by itself, in front of an interface that a test steers, and a client that sends octets."""

import asyncio
import inspect
import itertools
import re
from contextlib import asynccontextmanager

import uvloop

from reference_robot.webservices.endpoint import bound
from reference_robot.webservices.http.access import Admission, Authorization
from reference_robot.webservices.http.hosts import AllowedHosts
from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.messages import content
from reference_robot.webservices.http.port import Limits, Port
from reference_robot.webservices.http.server import serve
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
        raise AssertionError(f"nobody asks for a token, but {request} did")

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
        async with self.talk(octets) as (reader, writer):
            writer.write_eof()
            return await asyncio.wait_for(reader.read(), TIMEOUT)

    @asynccontextmanager
    async def talk(self, octets, **options):
        """Send octets on a connection, which is closed at the end."""
        reader, writer = await self.connect(**options)
        writer.write(octets)
        yield reader, writer
        writer.close()


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


def runs(**limits):
    """Run a test that is a coroutine function, with a robot of these limits, on the event loop that it runs on."""

    def decorated(test):
        async def with_robot(named):
            async with served(**limits) as robot:
                await test(robot, **named)

        def run(**named):
            uvloop.run(asyncio.wait_for(with_robot(named), TIMEOUT))

        names = list(inspect.signature(test).parameters.values())[1:]
        run.__name__, run.__signature__ = test.__name__, inspect.Signature(names)
        return run

    return decorated


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
