"""The state that the connections of one port share, and their limits."""

import asyncio
import os
import time
from dataclasses import dataclass
from email.utils import formatdate
from typing import Final, Protocol

from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.proxies import TrustedProxies

_AWAKE: Final = 150e-6  # seconds; a client on the same machine needs 20 to 100 µs from a response to its next request
_CROWDED: Final = 2.0  # runnable processes for each processor, averaged over a minute


class Client(Protocol):
    """A connection as seen by its port; ``due`` is the event-loop time at which the connection expires."""

    due: float

    def expire(self) -> None:
        """End the connection because ``due`` has passed."""

    def stop(self) -> None:
        """Close the connection if no response is pending; otherwise the pending response will be the last."""

    def abort(self) -> None:
        """Drop the connection and cancel the request in progress."""


@dataclass(frozen=True)
class Limits:
    """The limits on clients.

    Attributes:
        patience: Seconds that a client may take to send one request, and to read responses.
        keep_alive: Seconds that an idle connection is kept open for its next request.
        connections: Connections per port; two full ports and ROS need fewer file descriptors than the runner's 8,192.
        held: Bytes that the robot keeps for all connections together.
    """

    patience: float
    keep_alive: float = 60.0
    connections: int = 3800
    held: int = 64 * 1024 * 1024


class Held:
    """The memory kept for clients: incomplete requests, waiting requests, and responses that a client does not read.

    Attributes:
        size: Bytes kept for all connections of the ports that share this object.
    """

    def __init__(self) -> None:
        self.size = 0


class Port:
    """An interface with its connections, their common clock and their common limits.

    Args:
        interface: The interface that answers the requests.
        limits: The limits on clients.
        held: The memory counter; several ports may share one.
        proxies: The proxies whose X-Forwarded fields are trusted.

    Attributes:
        date: The Date header field, less than two seconds old (RFC 9110 6.6.1).
        is_empty: An event that is set while there are no connections.
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
        self._answered_at = 0.0
        self._awake_until = 0.0
        self._may_poll = not _is_crowded()
        self.is_empty = asyncio.Event()
        self.is_empty.set()
        self._clients: set[Client] = set()

    def add(self, client: Client) -> bool:
        """Register a connection; return False if there are too many."""
        self._clients.add(client)
        self.is_empty.clear()
        return len(self._clients) <= self._limits.connections

    def has_room_for(self, more: int) -> bool:
        """Return whether ``more`` further connections are within the limit."""
        return len(self._clients) + more <= self._limits.connections

    def remove(self, client: Client) -> None:
        """Remove a closed connection."""
        self._clients.discard(client)
        if not self._clients:
            self.is_empty.set()

    def is_full(self) -> bool:
        """Return whether more memory is kept for clients than the limit."""
        return self.held.size > self._limits.held

    def answered(self, began: float, now: float) -> None:
        """Poll for 0.15 ms without sleeping if the request came within 0.15 ms of the last response.

        After sleep, a processor runs the same code two to three times as slowly. Clients that send one request after
        the other are therefore served sooner, for no more processor time. Other clients do not cause polling, and on a
        machine whose processors are in demand nothing does: there they do not sleep.

        Args:
            began: When the request began, by ``time.perf_counter``.
            now: The time of its response, by the same clock.
        """
        if self._may_poll and began < self._answered_at + _AWAKE:
            if not self._awake_until:
                self.loop.call_soon(self._poll)
            self._awake_until = now + _AWAKE
        self._answered_at = now

    def tick(self) -> None:
        """Update the Date field and whether to poll, end connections whose time is over; called every half second."""
        self.date = _date()
        self._may_poll = not _is_crowded()
        now = self.loop.time()
        for client in [client for client in self._clients if client.due <= now]:
            client.expire()

    def stop(self) -> None:
        """Close idle connections; the others close after their pending response."""
        self.is_stopping = True
        for client in list(self._clients):
            client.stop()

    def abort(self) -> None:
        """Drop all remaining connections."""
        for client in list(self._clients):
            client.abort()

    def _poll(self) -> None:
        """Keep the event loop from sleeping, which it never does while a call is due."""
        if time.perf_counter() < self._awake_until:
            self.loop.call_soon(self._poll)
        else:
            self._awake_until = 0.0


def _is_crowded() -> bool:
    """Return whether other programs wait for the machine's processors."""
    return os.getloadavg()[0] > _CROWDED * (os.cpu_count() or 1)


def _date() -> bytes:
    return f"date: {formatdate(time.time(), usegmt=True)}\r\n".encode()
