"""X-Forwarded-Proto and X-Forwarded-Host, which are accepted from trusted proxies only."""

from collections.abc import Iterable
from ipaddress import IPv4Network, IPv6Network, ip_address
from typing import Any, Final

from reference_robot.webservices.http.messages import Request

_SCHEMES: Final = {b"http": "http", b"https": "https"}


class TrustedProxies:
    """The IP networks of the trusted proxies."""

    def __init__(self, networks: Iterable[IPv4Network | IPv6Network] = ()) -> None:
        self._networks = tuple(networks)

    def include(self, peer: Any) -> bool:
        """Return whether a socket's peer is a trusted proxy; ``peer`` is its ``getpeername`` address, or None."""
        if not self._networks or not peer:
            return False
        address = ip_address(str(peer[0]).partition("%")[0])
        # A dual-stack socket reports IPv4 clients as IPv4-mapped IPv6 addresses (RFC 4291 2.5.5.2).
        address = getattr(address, "ipv4_mapped", None) or address
        return any(address in network for network in self._networks)


def take_forwarded(request: Request) -> None:
    """Set scheme and host of a request to the values in X-Forwarded-Proto and X-Forwarded-Host.

    The last member of a list is used, because the trusted proxy itself appends it to what it received.
    """
    host = _last(request.headers.get(b"x-forwarded-host"))
    if host:
        request.authority = host
    request.scheme = _SCHEMES.get(_last(request.headers.get(b"x-forwarded-proto")).lower(), request.scheme)


def _last(value: bytes | None) -> bytes:
    return (value or b"").rpartition(b",")[2].strip()
