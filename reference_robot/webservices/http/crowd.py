"""Which clients keep their connections when a port is full.

A new connection always gets a place while another client only waits. So a client that holds connections without using
them cannot keep others from stopping the robot. The connections that have waited longest are closed:

- first those of clients without a valid token, where tokens are required;
- among these, those of the addresses that have most connections.

A connection that is in use keeps its place, unless its address has far more connections than the new client's.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Hashable
from ipaddress import IPv6Address
from typing import Any, Final, Protocol

NEVER: Final = math.inf
_IN_USE: Final = 1.0  # seconds since the last response in which a connection counts as used
_AT_ONCE: Final = 64  # a full port closes this part of its connections, because sorting all for each would take long


class Client(Protocol):
    """A connection as seen by its port.

    Attributes:
        since: The time of the client's last step, such as connecting or its last response, by ``time.perf_counter``.
        allowed: Seconds that its next step may take; infinity while the robot works on a response.
        answered: The time of its last response, by the same clock; minus infinity before the first.
        is_known: Whether a request of the client has passed the access check.
    """

    since: float
    answered: float
    allowed: float
    is_known: bool

    def expire(self) -> None:
        """End the connection because the client's time has passed."""

    def give_way(self) -> None:
        """Close the connection at once, because another client gets its place."""

    def stop(self) -> None:
        """Close the connection if no response is pending; otherwise the pending response will be the last."""

    def abort(self) -> None:
        """Drop the connection and cancel the request in progress."""


def address_of(peer: Any) -> Hashable:
    """Return what identifies the host of a socket's peer: an IPv4 address, or the /64 network of an IPv6 address.

    One host usually has all addresses of a /64 network. ``peer`` is the address that ``getpeername`` returned, or None.
    """
    host = str(peer[0]) if peer else ""
    if ":" not in host:
        return host
    address = IPv6Address(host.partition("%")[0])
    # A dual-stack socket reports IPv4 clients as IPv4-mapped IPv6 addresses (RFC 4291 2.5.5.2).
    return str(address.ipv4_mapped or int(address) >> 64)


class Crowd:
    """The clients of one port, each with the address that it comes from.

    Args:
        most: Clients that the port may have.
        most_of_address: Clients that one address may have.
        is_guarded: Whether requests need a token, so that known clients go before others.
    """

    def __init__(self, most: int, most_of_address: int, *, is_guarded: bool) -> None:
        self._most = most
        self._most_of_address = most_of_address
        self._is_guarded = is_guarded
        self._address_of: dict[Client, Hashable] = {}
        self._counts: defaultdict[Hashable, int] = defaultdict(int)

    def __len__(self) -> int:
        return len(self._address_of)

    def __iter__(self) -> Any:
        return iter(list(self._address_of))

    def has_place_for(self, address: Hashable, now: float) -> bool:
        """Return whether a new client of this address gets a place; if need be, others give way."""
        if self._counts[address] >= self._most_of_address:
            self._make_room(address, [item for item in self if self._address_of[item] == address], now)
        elif len(self._address_of) >= self._most:
            self._make_room(address, list(self), now)
        else:
            return True
        return self._counts[address] < self._most_of_address and len(self) < self._most

    def add(self, client: Client, address: Hashable) -> None:
        """Add a client."""
        self._address_of[client] = address
        self._counts[address] += 1

    def replace(self, old: Client, new: Client) -> None:
        """Give the place of one client to another."""
        if old in self._address_of:
            address = self._address_of[old]
            self.remove(old)
            self.add(new, address)

    def remove(self, client: Client) -> None:
        """Remove a client, if it is there."""
        if client in self._address_of:
            address = self._address_of.pop(client)
            self._counts[address] -= 1
            if not self._counts[address]:
                del self._counts[address]

    def _make_room(self, address: Hashable, clients: list[Client], now: float) -> None:
        if self._is_guarded:
            clients = [one for one in clients if not one.is_known] or clients
        counts = Counter(self._address_of[one] for one in clients)
        most = max(counts.values())
        clients = [one for one in clients if 2 * counts[self._address_of[one]] >= most]
        if self._is_guarded or 2 * (counts[address] + 1) > most:
            clients = [one for one in clients if _only_waits(one, now)]
        clients.sort(key=lambda one: (one.allowed == NEVER, one.since))
        for client in clients[: max(1, self._most // _AT_ONCE)]:
            self.remove(client)
            client.give_way()


def _only_waits(client: Client, now: float) -> bool:
    return client.allowed < NEVER and not (client.is_known and now - client.answered < _IN_USE)
