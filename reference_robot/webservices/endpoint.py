"""The endpoint publisher: both interfaces on their own ports, in one process and one event loop.

The robot publishes its endpoints itself, without an application server (paper, "Purpose").
"""

import asyncio
import socket

from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.port import Limits, Port
from reference_robot.webservices.http.server import serve


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
        listener = socket.create_server(address, family=family, dualstack_ipv6=family == socket.AF_INET6)
    except OSError as error:
        raise PortInUseError(f"cannot listen on {host} port {port}: {error}") from error
    listener.settimeout(0)  # never blocks: the event loop is who waits
    return listener


class EndpointPublisher:
    """Serves interfaces until it is told to stop; a client may take ``patience`` seconds to send one request."""

    def __init__(self, interfaces: list[tuple[Interface, socket.socket]], patience: float) -> None:
        self._interfaces = interfaces
        self._patience = patience

    async def serve(self, stop: asyncio.Event, started: asyncio.Event) -> None:
        """Answer requests, setting ``started``, until ``stop`` is set; answers under way are finished then."""
        async with asyncio.TaskGroup() as group:
            listening = []
            for interface, listener in self._interfaces:
                listening.append(asyncio.Event())
                group.create_task(serve(Port(interface, Limits(self._patience)), listener, listening[-1], stop))
            for event in listening:
                await event.wait()
            started.set()
