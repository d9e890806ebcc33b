"""The endpoint publisher: both interfaces on their own ports, in one process and one event loop.

The robot publishes its endpoints itself, without an application server (paper, "Purpose").
"""

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from typing import Any, Final

import uvicorn

from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.protocol import RobotHttpProtocol

_BACKLOG: Final = 1024  # connections that may arrive at once
_KEEP_ALIVE: Final = 60  # seconds that an idle connection is kept for its next request
_LAST_WORDS: Final = 2  # seconds for answers under way when the robot stops
_SWEEP: Final = 0.5  # seconds between looks for overdue requests


class PortInUseError(OSError):
    """A port cannot be bound; the message names it and says why."""


def bound(host: str, port: int) -> socket.socket:
    """Return a TCP socket bound to host and port; port 0 takes a free one.

    Raises:
        PortInUseError: The address cannot be had.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        # It listens already, so that a port in use is found out at once.
        listener = socket.create_server(
            address, family=family, backlog=_BACKLOG, dualstack_ipv6=family == socket.AF_INET6
        )
    except OSError as error:
        raise PortInUseError(f"cannot listen on {host} port {port}: {error}") from error
    listener.settimeout(0)  # never blocks: the event loop is who waits
    return listener


class _Server(uvicorn.Server):
    """uvicorn, leaving signals to the runner: two servers live in one process.

    Attributes:
        answers: Set when the server has begun to listen.
    """

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.answers = asyncio.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen."""
        await super().startup(sockets)
        self.answers.set()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


class EndpointPublisher:
    """Serves interfaces until it is told to stop; a client may take ``read_deadline`` seconds to send one request."""

    def __init__(self, interfaces: list[tuple[Interface, socket.socket]], read_deadline: float) -> None:
        self._read_deadline = read_deadline
        self._listeners = [listener for _, listener in interfaces]
        self._servers = [_Server(_settings(interface)) for interface, _ in interfaces]

    async def serve(self, stop: asyncio.Event, started: asyncio.Event) -> None:
        """Answer requests, setting ``started``, until ``stop`` is set; answers under way are finished then."""
        async with asyncio.TaskGroup() as group:
            sweeping = group.create_task(self._end_overdue_requests())
            for server, listener in zip(self._servers, self._listeners, strict=True):
                group.create_task(server.serve(sockets=[listener]))
            await asyncio.gather(*(server.answers.wait() for server in self._servers))
            started.set()
            await stop.wait()
            for server in self._servers:
                server.should_exit = True
            sweeping.cancel()

    async def _end_overdue_requests(self) -> None:
        """End half-sent requests that would otherwise pile up: uvicorn waits for them forever."""
        now = asyncio.get_running_loop().time
        while True:
            await asyncio.sleep(_SWEEP)
            for server in self._servers:
                connections: Any = list(server.server_state.connections)
                for connection in connections:
                    connection.close_if_older(now() - self._read_deadline)


def _settings(interface: Interface) -> uvicorn.Config:
    return uvicorn.Config(
        interface,
        loop="uvloop",
        http=RobotHttpProtocol,
        ws="none",
        lifespan="off",
        interface="asgi3",
        access_log=False,
        log_config=None,
        log_level="error",
        proxy_headers=False,
        server_header=False,
        date_header=True,
        backlog=_BACKLOG,
        timeout_keep_alive=_KEEP_ALIVE,
        timeout_graceful_shutdown=_LAST_WORDS,
    )
