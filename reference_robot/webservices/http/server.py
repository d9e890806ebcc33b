"""The server of one port: listens, keeps the clock, and stops in order."""

import asyncio
import contextlib
import socket
import ssl
from collections.abc import Callable
from typing import Final

from reference_robot.webservices.http.connection import HttpConnection
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.http.tls import accept

_BACKLOG: Final = 1024  # connections that may arrive at once
_TICK: Final = 0.5  # seconds
_LAST_WORDS: Final = 2.0  # seconds for answers under way when the robot stops


async def serve(
    port: Port,
    listener: socket.socket,
    started: asyncio.Event,
    stop: asyncio.Event,
    context: ssl.SSLContext | None = None,
) -> None:
    """Answer requests, setting ``started``, until ``stop`` is set; answers under way are finished then.

    Args:
        port: What is behind the listener.
        listener: A socket that listens.
        started: Is set once requests are answered.
        stop: Ends it.
        context: What is needed for TLS; None for connections without.
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
