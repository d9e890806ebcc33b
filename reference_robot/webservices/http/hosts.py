"""The host names by which clients may address the robot, the base URL that it gives them, and trusted proxies.

Other names are rejected as DNS rebinding or a mistake.

In DNS rebinding, a page of evil.example changes its DNS entry to the robot's address, so that the browser treats the
robot as the page's own server. The Host field reveals the attack, because it still contains evil.example. A Host field
with an IP address is safe, because no DNS entry is involved.
"""

import ipaddress
import re
import socket
from collections.abc import Iterable
from functools import lru_cache
from ipaddress import IPv4Network, IPv6Network, ip_address
from typing import Any, Final

from reference_robot.webservices.http.messages import Request

ANY: Final = "*"

# RFC 3986 3.2.2 and 3.2.3: a name, an IPv4 address or an IPv6 address in brackets, and a port.
AUTHORITY: Final = re.compile(r"(?:(?P<name>[A-Za-z0-9._~-]+)|\[(?P<ipv6>[0-9A-Fa-f:.]+)\])(?::[0-9]*)?")
_NAME: Final = re.compile(r"\.?[A-Za-z0-9_-]+(?:\.[A-Za-z0-9_-]+)*\.?")

_LOCALHOST: Final = "localhost"


class AllowedHosts:
    """The set of host names that the robot accepts: localhost, every IP address, and the given names.

    Args:
        names: Further names; ``.example.org`` stands for all names below example.org, ``*`` for all names.
    """

    def __init__(self, names: Iterable[str] = ()) -> None:
        allowed = {name.lower().rstrip(".") for name in names}
        self._is_open = ANY in allowed
        self._names = {name for name in allowed if not name.startswith(".")}
        self._endings = (f".{_LOCALHOST}", *(name for name in allowed if name.startswith(".")))
        self.allows = lru_cache(maxsize=256)(self._allows)

    def _allows(self, authority: bytes) -> bool:
        if self._is_open or not authority:  # HTTP/1.0 has no Host field; browsers do not use HTTP/1.0
            return True
        parts = AUTHORITY.fullmatch(authority.decode("latin-1"))
        if parts is None:
            return False
        if parts["ipv6"] is not None or _is_address(parts["name"]):
            return True
        name = parts["name"].lower().rstrip(".")
        return name == _LOCALHOST or name in self._names or name.endswith(self._endings)


def is_host_pattern(text: str) -> bool:
    """Return whether a text is valid for ``AllowedHosts``: a host name, a domain after a dot, or an asterisk."""
    return text == ANY or _NAME.fullmatch(text) is not None


def own_names() -> list[str]:
    """Return this machine's host names: its own, and the multicast DNS name (RFC 6762)."""
    name = socket.gethostname()
    return [name] if "." in name else [name, f"{name}.local"]


def is_loopback(host: str) -> bool:
    """Return whether all addresses of a host are loopback addresses, which other machines cannot reach."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError:
        return False  # binding the address will report the error
    return all(ipaddress.ip_address(str(address[0])).is_loopback for *_, address in found)


def _is_address(name: str) -> bool:
    try:
        ipaddress.IPv4Address(name)
    except ValueError:
        return False
    return True


def url_of(host: str, port: int, scheme: str) -> str:
    """Return the base URL of an endpoint, without a trailing slash; an IPv6 host gets brackets."""
    return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"


class Address:
    """The base URL of an interface.

    Args:
        bound: The URL of the listening socket, for clients whose Host field is not a valid address.
        public: The URL given to all clients; None to give each client the URL that its request used.
    """

    def __init__(self, bound: str, public: str | None = None) -> None:
        self._bound = bound
        self._scheme = bound.partition(":")[0]
        self._public = public

    def __call__(self, request: Request) -> str:
        """Return the base URL for the client of a request, without a trailing slash."""
        if self._public is not None:
            return self._public
        host = request.authority.decode("latin-1")
        return f"{request.scheme or self._scheme}://{host}" if AUTHORITY.fullmatch(host) else self._bound

    def location(self, path: str) -> bytes:
        """Return the value of a Location header for a path (RFC 9110 10.2.2).

        Without a public URL the value is relative. That is correct behind every proxy that does not add a path of its
        own.
        """
        return ((self._public or "") + path).encode()


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
