"""What the connections of one port share, and what all of them together may use."""

import asyncio
import time
from dataclasses import dataclass
from email.utils import formatdate
from typing import Protocol

from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.proxies import TrustedProxies


class Client(Protocol):
    """A connection, as the port's clock sees it: ``due`` is when it expires, by the event loop's time."""

    due: float

    def expire(self) -> None:
        """End what is overdue."""

    def stop(self) -> None:
        """Close, unless an answer is under way: that is the connection's last."""

    def abort(self) -> None:
        """Drop the connection, and what the robot works on for it."""


@dataclass(frozen=True)
class Limits:
    """What clients may use.

    Attributes:
        patience: Seconds that a client may take to send one request, and to read answers.
        keep_alive: Seconds that an idle connection is kept for its next request.
        connections: Of one port; two ports of them and ROS stay within the runner's 8,192 descriptors.
        held: Octets that all connections together may make the robot keep.
    """

    patience: float
    keep_alive: float = 60.0
    connections: int = 3800
    held: int = 64 * 1024 * 1024


class Held:
    """What clients make the robot keep: half a request, one that waits, an answer that nobody reads.

    Attributes:
        octets: Of all connections that share it, those of several ports too.
    """

    def __init__(self) -> None:
        self.octets = 0


class Port:
    """The interface behind a port, its connections, their common clock and their common limits.

    Args:
        interface: What answers.
        limits: What clients may use.
        held: What is kept for clients; several ports may share it.
        proxies: Whose word on what was asked is taken.

    Attributes:
        date: The Date field, less than two seconds old (RFC 9110 6.6.1).
        is_empty: Set while there are no connections.
    """

    def __init__(
        self, interface: Interface, limits: Limits, held: Held | None = None, proxies: TrustedProxies | None = None
    ) -> None:
        self.interface = interface
        self.patience = limits.patience
        self.keep_alive = limits.keep_alive
        self._limits = limits
        self.loop = asyncio.get_running_loop()
        self.held = held or Held()
        self.proxies = proxies or TrustedProxies()
        self.date = _date()
        self.is_stopping = False
        self.is_empty = asyncio.Event()
        self.is_empty.set()
        self._clients: set[Client] = set()

    def add(self, client: Client) -> bool:
        """Register a connection; return False where there are too many."""
        self._clients.add(client)
        self.is_empty.clear()
        return len(self._clients) <= self._limits.connections

    def has_room_for(self, more: int) -> bool:
        """Tell whether so many more connections may come."""
        return len(self._clients) + more <= self._limits.connections

    def remove(self, client: Client) -> None:
        """Forget a connection that is closed."""
        self._clients.discard(client)
        if not self._clients:
            self.is_empty.set()

    def is_full(self) -> bool:
        """Tell whether more is kept for clients than may be."""
        return self.held.octets > self._limits.held

    def tick(self) -> None:
        """Look at the clock."""
        self.date = _date()
        now = self.loop.time()
        for client in [client for client in self._clients if client.due <= now]:
            client.expire()

    def stop(self) -> None:
        """Take no more requests."""
        self.is_stopping = True
        for client in list(self._clients):
            client.stop()

    def abort(self) -> None:
        """Drop what is left."""
        for client in list(self._clients):
            client.abort()


def _date() -> bytes:
    return f"date: {formatdate(time.time(), usegmt=True)}\r\n".encode()
