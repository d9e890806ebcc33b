"""The HTTP server of one port: accepts connections, ends overdue ones, and shuts down in order."""

import asyncio
import contextlib
import socket
import ssl
from collections.abc import Callable
from typing import Final

from reference_robot.webservices.http.connection import HttpConnection
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.http.tls import accept

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
    end_listening: Callable[[], object]
    if context is None:
        server = await port.loop.create_server(lambda: HttpConnection(port), sock=listener, backlog=_BACKLOG)
        end_listening = server.close
    else:
        end_listening = port.loop.create_task(accept(port, listener, context)).cancel
    ticking = port.loop.create_task(_tick(port))
    started.set()
    await stop.wait()
    end_listening()
    port.stop()
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_LAST_WORDS):
            await port.is_empty.wait()
    ticking.cancel()
    port.abort()


async def _tick(port: Port) -> None:
    while True:
        await asyncio.sleep(_TICK)
        port.tick()
