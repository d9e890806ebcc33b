"""The state that the connections of one port share, and their limits."""

import asyncio
import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from email.utils import formatdate
from typing import Any, Final

from reference_robot.webservices.http.crowd import Client, Crowd, address_of
from reference_robot.webservices.http.hosts import TrustedProxies
from reference_robot.webservices.http.interface import Interface

_AWAKE: Final = 150e-6  # seconds; a client on the same machine needs 20 to 100 µs from a response to its next request
_TURNS: Final = 5e-3  # seconds for what clients have postponed, before new requests of other clients get their turn
_REFUSED: Final = 100  # connections beyond the limit that are told so and closed
_CROWDED: Final = 2.0  # runnable processes for each processor, averaged over a minute


@dataclass(frozen=True)
class Limits:
    """The limits on clients.

    Attributes:
        patience: Seconds that a client may take to send one request, and to read responses.
        keep_alive: Seconds that an idle connection is kept open for its next request.
        unknown: Where tokens are required: seconds that a client without a valid token may take for each step, such as
            the TLS handshake, the head of a request, or to begin its next request.
        connections: Connections per port.
        of_address: Connections per port from one address; None for seven eighths of ``connections``.
        held: Bytes that the robot keeps for all connections together.
    """

    patience: float
    keep_alive: float = 60.0
    unknown: float = 5.0
    connections: int = 3800
    of_address: int | None = None
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
        patience: Seconds that a client may take to send one request, and to read responses.
        keep_alive: Seconds that an idle connection is kept open for its next request.
        unknown_patience: ``patience`` for a client that has shown no valid token.
        unknown_keep_alive: ``keep_alive`` for such a client.
        date: The Date header field, less than two seconds old (RFC 9110 6.6.1).
        is_empty: An event that is set while there are no connections.
    """

    def __init__(
        self, interface: Interface, limits: Limits, held: Held | None = None, proxies: TrustedProxies | None = None
    ) -> None:
        self.interface = interface
        self.patience = limits.patience
        self.keep_alive = limits.keep_alive
        is_guarded = interface.is_guarded
        self.unknown_patience = min(limits.patience, limits.unknown) if is_guarded else limits.patience
        self.unknown_keep_alive = min(limits.keep_alive, limits.unknown) if is_guarded else limits.keep_alive
        self._most_held = limits.held
        self._share = limits.held // limits.connections
        self._turns: deque[Callable[[], None]] = deque()
        self._takes_turns = False
        self._refused_most = limits.connections + _REFUSED
        self._clients = Crowd(
            limits.connections,
            limits.connections - limits.connections // 8 if limits.of_address is None else limits.of_address,
            is_guarded=is_guarded,
        )
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

    def add(self, client: Client, peer: Any) -> bool:
        """Register a connection; return False if there are too many, and none of them can give way.

        A trusted proxy's connections stand for many clients, so each counts as if it had an address of its own.

        Args:
            client: The connection.
            peer: The address of its other end, from ``getpeername``.
        """
        address: Any = client if self.proxies.include(peer) else address_of(peer)
        has_place = self._clients.has_place_for(address, time.perf_counter())
        self._clients.add(client, address)
        self.is_empty.clear()
        return has_place

    def is_overrun(self) -> bool:
        """Return whether so many refused connections are being closed that a further one gets no response."""
        return len(self._clients) > self._refused_most

    def replace(self, old: Client, new: Client) -> None:
        """Register a connection in the place of its TLS handshake."""
        self._clients.replace(old, new)

    def remove(self, client: Client) -> None:
        """Remove a closed connection."""
        self._clients.remove(client)
        if not self._clients:
            self.is_empty.set()

    def is_full_for(self, size: int) -> bool:
        """Return whether a client may not keep ``size`` bytes: memory is full, and they are more than its share."""
        return self.held.size > self._most_held and size > self._share

    def postpone(self, turn: Callable[[], None]) -> None:
        """Call a function that parses what a client has sent, after other clients have had their turn."""
        self._turns.append(turn)
        if not self._takes_turns:
            self._takes_turns = True
            self.loop.call_soon(self._take_turns)

    def note_answer(self, began: float, now: float) -> None:
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
        now = time.perf_counter()
        for client in self._clients:
            if client.since + client.allowed <= now:
                client.expire()

    def stop(self) -> None:
        """Close idle connections; the others close after their pending response."""
        self.is_stopping = True
        for client in self._clients:
            client.stop()

    def abort(self) -> None:
        """Drop all remaining connections."""
        for client in self._clients:
            client.abort()

    def _take_turns(self) -> None:
        until = time.perf_counter() + _TURNS
        try:
            while self._turns and time.perf_counter() < until:
                self._turns.popleft()()
        finally:
            self._takes_turns = bool(self._turns)
            if self._takes_turns:
                self.loop.call_soon(self._take_turns)

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
