"""A simulated network link: a TCP relay in a process of its own that adds delay, jitter and stalls.

Bytes keep their order, as in TCP, so that a segment that was lost and sent again delays those behind it. The relay
does not shrink TCP windows and never drops data for good.
"""

import asyncio
import contextlib
import multiprocessing
import random
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection as Pipe

from conformance.transport.raw import RESET
from proof.selftest.at_once import safe_path

Address = tuple[str, int]
# An Ethernet frame's worth of TCP, octets.
_SEGMENT = 1460
_WINDOW = 262_144  # bytes under way in one direction before the sender waits
_START_S = 20.0  # time in which the link must start, s


@dataclass(frozen=True)
class Link:
    """The properties of a simulated network link.

    Attributes:
        name: its name.
        says: a short description.
        delay_s: shortest and longest one-way delay of a segment, s.
        late: share of segments that arrive ``late_s`` later and delay those behind them.
        late_s: additional delay of late segments, s.
        octets_per_s: bandwidth in each direction of one connection, bytes per second.
        outage_s: duration of the one outage, s.
        outage_after_s: the outage begins between these times after the first connection, s.
    """

    name: str
    says: str
    delay_s: tuple[float, float]
    late: float = 0.0
    late_s: float = 0.3
    octets_per_s: float = 2e6
    outage_s: float = 0.0
    outage_after_s: tuple[float, float] = (3.0, 9.0)


LINKS = (
    Link("wifi", "40 to 80 ms there and back, 1 % of segments 300 ms later", (0.02, 0.04), late=0.01),
    Link("far", "150 to 250 ms there and back", (0.075, 0.125)),
    Link("outage", "a link that is gone for 2 s in mid-run", (0.001, 0.003), outage_s=2.0),
)


def _chance(seed: str) -> random.Random:
    return random.Random(seed)  # noqa: S311 - no secret


class Direction:
    """One direction of one connection: computes when each segment arrives, reproducibly for a seed.

    Args:
        link: the link's properties.
        seed: seed of everything random.
        outage: start and end of the outage, s on the clock that ``arrival`` is given.
    """

    def __init__(self, link: Link, seed: str, outage: tuple[float, float]) -> None:
        self._link = link
        self._random = _chance(seed)
        self._outage = outage
        self._free = self._last = 0.0

    def arrival(self, sent: float, octets: int) -> float:
        """Return when a segment sent at ``sent`` arrives; never before the segment sent before it."""
        begins, ends = self._outage
        self._free = max(self._free, sent) + octets / self._link.octets_per_s
        left = ends if begins <= self._free < ends else self._free
        on_its_way = self._random.uniform(*self._link.delay_s)
        if self._random.random() < self._link.late:
            on_its_way += self._link.late_s
        self._last = max(self._last, left + on_its_way)
        return self._last


@contextlib.contextmanager
def link_to(link: Link, seed: int, *targets: Address) -> Iterator[list[Address]]:
    """Relay connections to each target over the link until the context ends; yield the relay's addresses in order.

    Raises:
        OSError: the relay does not start.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_run, args=(link, seed, targets, theirs), daemon=True)
    with safe_path():
        process.start()
    theirs.close()
    try:
        if not ours.poll(_START_S):
            raise OSError("the relay does not start")
        yield ours.recv()
    except EOFError as error:
        raise OSError("the relay ended at its start") from error
    finally:
        process.terminate()
        process.join()
        ours.close()


def _run(link: Link, seed: int, targets: tuple[Address, ...], pipe: Pipe) -> None:
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_Relay(link, seed).serve(targets, pipe))


class _Relay:
    """All connections over one link."""

    def __init__(self, link: Link, seed: int) -> None:
        self._link, self._seed = link, seed
        self._connections = 0
        self._outage = (float("inf"), float("inf"))
        self._under_way: set[asyncio.Task[None] | None] = set()

    async def serve(self, targets: tuple[Address, ...], pipe: Pipe) -> None:
        servers = [await self._listen(target) for target in targets]
        pipe.send([server.sockets[0].getsockname()[:2] for server in servers])
        await asyncio.gather(*(server.serve_forever() for server in servers))

    async def _listen(self, target: Address) -> asyncio.Server:
        async def on_accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            # The loop itself holds tasks weakly: one in which both ways wait for the outage to end would be collected.
            task = asyncio.current_task()
            self._under_way.add(task)
            try:
                await self._relay(target, reader, writer)
            finally:
                self._under_way.discard(task)

        return await asyncio.start_server(on_accept, "127.0.0.1", 0)

    async def _relay(self, target: Address, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        now = asyncio.get_running_loop().time()
        if not self._connections and self._link.outage_s:
            begins = now + _chance(f"{self._seed}/outage").uniform(*self._link.outage_after_s)
            self._outage = (begins, begins + self._link.outage_s)
        self._connections += 1
        seed = f"{self._seed}/{self._connections}"
        there, back = (Direction(self._link, f"{seed}/{way}", self._outage) for way in ("there", "back"))
        # SYN and its answer: no data may overtake them.
        await asyncio.sleep(back.arrival(there.arrival(now, 0), 0) - now)
        try:
            from_robot, to_robot = await asyncio.open_connection(*target)
        except OSError:
            _abort(writer)
            return
        await asyncio.gather(_Pump(there).run(reader, to_robot), _Pump(back).run(from_robot, writer))
        for stream_writer in (writer, to_robot):
            stream_writer.close()


class _Pump:
    """One direction of one relayed connection: writes the bytes it reads when they are due to arrive."""

    def __init__(self, direction: Direction) -> None:
        self._direction = direction
        # Bytes with their time of arrival; empty at the end, None when the connection was broken off.
        self._way: asyncio.Queue[tuple[float, bytes | None]] = asyncio.Queue(_WINDOW // _SEGMENT)

    async def run(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        reading = asyncio.create_task(self._read(reader))
        try:
            await self._write(writer)
        finally:
            reading.cancel()

    async def _read(self, reader: asyncio.StreamReader) -> None:
        clock = asyncio.get_running_loop().time
        while True:
            try:
                octets = await reader.read(_SEGMENT)
            except OSError:
                await self._way.put((self._direction.arrival(clock(), 0), None))
                return
            await self._way.put((self._direction.arrival(clock(), len(octets)), octets))
            if not octets:
                return

    async def _write(self, writer: asyncio.StreamWriter) -> None:
        clock = asyncio.get_running_loop().time
        with contextlib.suppress(OSError):
            while True:
                arrives, octets = await self._way.get()
                await asyncio.sleep(max(0.0, arrives - clock()))
                if octets is None:
                    _abort(writer)
                    return
                if not octets:
                    if writer.can_write_eof():
                        writer.write_eof()
                    return
                writer.write(octets)
                await writer.drain()


def _abort(writer: asyncio.StreamWriter) -> None:
    """Reset a connection, as the other end did."""
    sock: socket.socket = writer.get_extra_info("socket")
    with contextlib.suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    writer.transport.abort()
