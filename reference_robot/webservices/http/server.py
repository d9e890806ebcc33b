"""The HTTP server of one port: accepts connections, ends overdue ones, and shuts down in order."""

import asyncio
import contextlib
import logging
import socket
import ssl
from time import thread_time
from typing import Any, Final

from reference_robot.webservices.http.connection import HttpConnection
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.http.tls import begin_handshake

_LOGGER: Final = logging.getLogger(__name__)
_AT_ONCE: Final = 64  # connections that are accepted before clients that have one get their turn
_SHORT_TURN: Final = 2e-3  # seconds of processor time; one connection in each such turn accepts a full backlog in 2 s
_PAUSE: Final = 0.1  # seconds after a failed accept
_BACKLOG: Final = 1024  # connections that may wait to be accepted
_TICK: Final = 0.5  # seconds
_LAST_WORDS: Final = 2.0  # seconds for pending responses when the robot stops


async def serve(
    port: Port,
    listener: socket.socket,
    started: asyncio.Event,
    stop: asyncio.Event,
    context: ssl.SSLContext | None = None,
) -> None:
    """Serve requests until ``stop`` is set; requests in progress are finished, for at most two seconds.

    Args:
        port: The interface behind the listener, with its connections and limits.
        listener: A listening socket.
        started: An event that is set once requests are served.
        stop: The event that ends the server.
        context: The TLS settings; None for plain HTTP.
    """
    listener.listen(_BACKLOG)
    accepting = _Accepting(port, listener, context)
    await accepting.begin()
    ticking = port.loop.create_task(_tick(port))
    started.set()
    await stop.wait()
    accepting.end()
    port.stop()
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_LAST_WORDS):
            await port.is_empty.wait()
    ticking.cancel()
    port.abort()


class _Accepting:
    """Accepts connections, many at a time.

    ``create_server`` accepts one connection in each turn of the event loop. New clients would wait behind the
    connections of a client that opens many. So after a long turn, this class accepts all connections that wait. After a
    short turn it does not look for more, because each look costs as much as a tenth of a request.
    """

    def __init__(self, port: Port, listener: socket.socket, context: ssl.SSLContext | None) -> None:
        self._port = port
        self._listener = listener
        self._context = context
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._accepted_at = 0.0  # processor time of this thread

    async def begin(self) -> None:
        """Accept connections from now on."""
        if self._context is None:
            self._server = await self._port.loop.create_server(self._on_accept, sock=self._listener, backlog=_BACKLOG)
        else:
            self._resume()

    def end(self) -> None:
        """Accept no more connections."""
        if self._server is not None:
            self._server.close()
        else:
            self._port.loop.remove_reader(self._listener)
            self._listener.close()

    def _resume(self) -> None:
        if self._listener.fileno() >= 0:
            self._port.loop.add_reader(self._listener, self._accept)

    def _on_accept(self) -> HttpConnection:
        now = thread_time()
        if now > self._accepted_at + _SHORT_TURN:
            self._accept()
        self._accepted_at = now
        return HttpConnection(self._port)

    def _accept(self) -> None:
        for _ in range(_AT_ONCE):
            try:
                client, peer = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:  # no file descriptor is left, or the client has disconnected
                _LOGGER.warning("cannot accept a connection: %s", error)
                if self._context is not None:
                    self._port.loop.remove_reader(self._listener)
                    self._port.loop.call_later(_PAUSE, self._resume)
                return
            client.setblocking(False)  # noqa: FBT003 - the standard library's signature
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self._context is None:
                task = self._port.loop.create_task(self._connect(client))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
            else:
                begin_handshake(self._port, client, peer, self._context)

    async def _connect(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError):  # the client has disconnected
            await self._port.loop.connect_accepted_socket(lambda: HttpConnection(self._port), client)


async def _tick(port: Port) -> None:
    while True:
        await asyncio.sleep(_TICK)
        port.tick()
