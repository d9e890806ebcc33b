"""The endpoint publisher: serves REST and SOAP on a port each, in one process and one event loop.

The robot publishes its endpoints itself, without an application server (paper, "Purpose").
"""

import asyncio
import socket
import ssl
from dataclasses import dataclass

from reference_robot.webservices.http.hosts import TrustedProxies
from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.port import Held, Limits, Port
from reference_robot.webservices.http.server import serve


class PortInUseError(OSError):
    """An error for a port that cannot be bound; the message names the port and the reason."""


def bound(host: str, port: int) -> socket.socket:
    """Return a TCP socket that listens on a host and port; port 0 selects a free port.

    Raises:
        PortInUseError: The address cannot be bound.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        # create_server also listens, so that a port in use is detected at once.
        listener = socket.create_server(address, family=family, dualstack_ipv6=family == socket.AF_INET6)
    except OSError as error:
        raise PortInUseError(f"cannot listen on {host} port {port}: {error}") from error
    listener.settimeout(0)  # non-blocking: the event loop waits
    return listener


@dataclass(frozen=True)
class EndpointPublisher:
    """A server for several interfaces, each on its own socket.

    Attributes:
        interfaces: Each interface with its listening socket.
        limits: What clients may use of each interface; the limit on memory applies to all interfaces together.
        proxies: The proxies whose X-Forwarded fields are trusted.
        context: The TLS settings; None for plain HTTP.
    """

    interfaces: list[tuple[Interface, socket.socket]]
    limits: Limits
    proxies: TrustedProxies
    context: ssl.SSLContext | None

    async def serve(self, stop: asyncio.Event, started: asyncio.Event) -> None:
        """Serve requests until ``stop`` is set; set ``started`` once all interfaces are ready.

        Requests in progress are finished before the method returns.
        """
        held = Held()
        async with asyncio.TaskGroup() as group:
            listening = []
            for interface, listener in self.interfaces:
                listening.append(asyncio.Event())
                port = Port(interface, self.limits, held, self.proxies)
                group.create_task(serve(port, listener, listening[-1], stop, self.context))
            for event in listening:
                await event.wait()
            started.set()
