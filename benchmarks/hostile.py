"""Hostile clients: the other side of ``soak.py``, as a process of its own.

``python hostile.py REST_PORT SOAP_PORT`` prints ``ready`` and keeps all kinds busy until its standard input ends. Then
it prints how often each kind finished. All traffic goes to loopback, and each kind has a limited rate.
"""

import asyncio
import contextlib
import json
import os
import socket
import struct
import sys
from collections import Counter
from collections.abc import Callable, Coroutine
from typing import Any

PUBLISHERS, VELOCITY = "/turtlesim_publisher_ws", "/robot/velocity/"
ANSWER = 20.0  # seconds for an attack's answer
_RESET = struct.pack("ii", 1, 0)  # SO_LINGER: closing resets the connection
_ENVELOPE = '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>{}</s:Body></s:Envelope>'


def head(port: int, method: str, path: str, *fields: str) -> bytes:
    """Return the head of a request."""
    return "\r\n".join([f"{method} {path} HTTP/1.1", f"Host: 127.0.0.1:{port}", *fields, "", ""]).encode()


def message(port: int, method: str, path: str, media_type: str, body: str) -> bytes:
    """Return a request with content."""
    return head(port, method, path, f"Content-Type: {media_type}", f"Content-Length: {len(body)}") + body.encode()


def documents(number: int) -> list[str]:
    """Return documents as in the class ``xml-security``; each number gives others."""
    entities = "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9))
    return [
        f'<!DOCTYPE a [<!ENTITY a "0">{entities}]><a>&j;</a>',
        f'<!DOCTYPE a [<!ENTITY a "{"x" * 50_000}">]><a>{"&a;" * 10_000}</a>',
        '<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/hostname">]><a>&a;</a>',
        '<!DOCTYPE a SYSTEM "http://127.0.0.1:1/a.dtd"><a/>',
        "<a>" * 50_000,
        "<a " + " ".join(f'a{i}=""' for i in range(20_000)) + "/>",
        f"<{'n' * 500_000}/>",
        "".join(f"<d{number}n{i}>" for i in range(200)),
        "<a>" + "".join(f"<d{number}m{i}/>" for i in range(1990)) + "</a>",
        '<a xmlns:i="http://www.w3.org/2001/XInclude"><i:include href="file:///etc/hostname" parse="text"/></a>',
        f"<a>{'x' * 1_000_000}</a>",
        f"<?robot {number}?><a/>",
    ]


class Hostile:
    """Hostile clients of all kinds; ``done`` counts their actions, ``failed`` the wrong reactions of the robot."""

    def __init__(self, rest: int, soap: int) -> None:
        self.rest, self.soap = rest, soap
        self.done: Counter[str] = Counter()
        self.failed: Counter[str] = Counter()

    def kinds(self) -> list[tuple[Callable[[], Coroutine[Any, Any, None]], int]]:
        """Return each kind of client, and how many clients of that kind run at once."""
        return [
            (self.slow_sender, 40),
            (self.line_ends_alone, 40),
            (self.never_reads, 10),
            (self.vanishes, 2),
            (self.reconnects, 2),
            (self.attacks_xml, 1),
            (self.no_http, 1),
            (self.too_much, 1),
        ]

    async def slow_sender(self) -> None:
        """Send a byte now and then, until the robot closes the connection."""
        reader, writer = await self._connect(self.rest)
        octets = message(self.rest, "PUT", VELOCITY, "application/json", " " * 5000)
        for octet in octets:
            writer.write(bytes([octet]))
            await asyncio.sleep(0.3)
            if reader.at_eof() or writer.is_closing():
                break
        await self._ended(reader, writer)

    async def line_ends_alone(self) -> None:
        """Send a request and a bare line end, and wait until the robot closes."""
        reader, writer = await self._connect(self.rest)
        writer.write(head(self.rest, "GET", "/robot/pose/") + b"\r\n")
        await self._ended(reader, writer, within=90)

    async def never_reads(self) -> None:
        """Send many requests, and read no response."""
        reader, writer = await self._connect(self.rest)
        writer.transport.pause_reading()
        with contextlib.suppress(ConnectionError, TimeoutError):
            for _ in range(200):
                writer.write(head(self.rest, "GET", "/openapi.json") * 10)
                async with asyncio.timeout(1.0):
                    await writer.drain()
        await asyncio.sleep(15)  # longer than the robot waits
        writer.transport.resume_reading()
        await self._ended(reader, writer)

    async def vanishes(self) -> None:
        """Send half a request or a whole one, and reset the connection."""
        octets = message(self.soap, "POST", PUBLISHERS, "text/xml", _ENVELOPE.format(""))
        for part in (octets[:20], octets[:-30], octets):
            _, writer = await self._connect(self.soap)
            writer.write(part)
            await asyncio.sleep(0.05)
            writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            writer.transport.abort()

    async def reconnects(self) -> None:
        """Open a connection, send one request, and close the connection."""
        await self._asks(self.rest, head(self.rest, "GET", "/robot/pose/", "Connection: close"), {200, 503})
        await asyncio.sleep(0.05)

    async def attacks_xml(self) -> None:
        """Send every attack over both interfaces; each has to be refused."""
        for document in documents(self.done["attacks_xml"]):
            put = message(self.rest, "PUT", VELOCITY, "application/xml", document)
            post = message(self.soap, "POST", PUBLISHERS, "text/xml", _ENVELOPE.format(document))
            bare = message(self.soap, "POST", PUBLISHERS, "text/xml", document)
            await self._asks(self.rest, put, {400, 413, 422})
            await self._asks(self.soap, post, {400, 413, 500})
            await self._asks(self.soap, bare, {400, 413, 500})
            await asyncio.sleep(0.1)

    async def no_http(self) -> None:
        """Send bytes that are not HTTP."""
        for octets in (b"\x16\x03\x01\x02\x00" * 100, b"GET\r\n\r\n", b"\0" * 5000, os.urandom(5000) + b"\r\n\r\n"):
            await self._asks(self.rest, octets, {400, 408, 431})
            await asyncio.sleep(0.2)

    async def too_much(self) -> None:
        """Send more than a request may have: fields, a target, content, chunks."""
        fields = [f"X-{number}: {'x' * 100}" for number in range(1000)]
        await self._asks(self.rest, head(self.rest, "GET", "/robot/pose/", *fields), {431})
        await self._asks(self.rest, head(self.rest, "GET", "/" + "x" * 20_000), {414})
        content = message(self.rest, "PUT", VELOCITY, "application/json", " " * 3_000_000)
        await self._asks(self.rest, content, {413})
        chunked = head(self.rest, "PUT", VELOCITY, "Transfer-Encoding: chunked")
        await self._asks(self.rest, chunked + b"10000\r\n%b\r\n" % (b" " * 0x10000) * 40 + b"0\r\n\r\n", {413})
        await asyncio.sleep(0.5)

    async def _connect(self, port: int) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        async with asyncio.timeout(ANSWER):
            return await asyncio.open_connection("127.0.0.1", port)

    async def _asks(self, port: int, octets: bytes, expected: set[int]) -> None:
        """Send a request; count it as failed if there is a response with an unexpected status."""
        reader, writer = await self._connect(port)
        line = b""
        with contextlib.suppress(ConnectionError):
            writer.write(octets)
            async with asyncio.timeout(ANSWER):
                line = await reader.readline()
        if line and int(line.split()[1]) not in expected:
            self.failed[f"{line.decode().strip()} where {sorted(expected)} are expected"] += 1
        writer.transport.abort()

    async def _ended(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, within: float = 30.0) -> None:
        """Wait until the robot has closed the connection."""
        with contextlib.suppress(ConnectionError):
            async with asyncio.timeout(within):
                await reader.read()
        writer.transport.abort()

    async def for_ever(self, kind: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Repeat a kind."""
        name = getattr(kind, "__name__", "")
        while True:
            try:
                await kind()
            except TimeoutError:
                self.failed[f"{name}: the robot did nothing in time"] += 1
            except OSError as error:
                self.failed[f"{name}: {type(error).__name__}"] += not isinstance(error, ConnectionError)
            self.done[name] += 1


async def main(rest: int, soap: int) -> None:
    """Keep all kinds busy until standard input ends."""
    hostile = Hostile(rest, soap)
    print("ready", flush=True)
    tasks = [asyncio.create_task(hostile.for_ever(kind)) for kind, count in hostile.kinds() for _ in range(count)]
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()
    await asyncio.wait(tasks, timeout=ANSWER)
    print(json.dumps({"done": hostile.done, "failed": {name: n for name, n in hostile.failed.items() if n}}))


if __name__ == "__main__":
    os.nice(5)
    asyncio.run(main(*map(int, sys.argv[1:])))
