"""The endpoint publisher: both interfaces on their own ports, in one process and one event loop.

The robot publishes its endpoints itself, without an application server (paper, "Purpose").
"""

import asyncio
import socket
import ssl

from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.port import Held, Limits, Port
from reference_robot.webservices.http.proxies import TrustedProxies
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
    """Serves interfaces until it is told to stop.

    Args:
        interfaces: Each with the socket on which it listens.
        limits: What clients may use of each interface; what is kept for them, of all together.
        proxies: Whose word on what was asked is taken.
        context: What is needed for TLS; None for HTTP without.
    """

    def __init__(
        self,
        interfaces: list[tuple[Interface, socket.socket]],
        limits: Limits,
        proxies: TrustedProxies,
        context: ssl.SSLContext | None,
    ) -> None:
        self._interfaces = interfaces
        self._limits = limits
        self._proxies = proxies
        self._context = context

    async def serve(self, stop: asyncio.Event, started: asyncio.Event) -> None:
        """Answer requests, setting ``started``, until ``stop`` is set; answers under way are finished then."""
        held = Held()
        async with asyncio.TaskGroup() as group:
            listening = []
            for interface, listener in self._interfaces:
                listening.append(asyncio.Event())
                port = Port(interface, self._limits, held, self._proxies)
                group.create_task(serve(port, listener, listening[-1], stop, self._context))
            for event in listening:
                await event.wait()
            started.set()
