"""The base URL that descriptions carry: the one by which the client came."""

import re
from typing import Final

from reference_robot.webservices.http.messages import Request

# RFC 3986 3.2.2 and 3.2.3: a name, an IPv4 address or an IPv6 address in brackets, and a port.
_HOST: Final = re.compile(r"(?:[A-Za-z0-9._~-]+|\[[0-9A-Fa-f:.]+\])(?::[0-9]+)?")


def url_of(host: str, port: int) -> str:
    """Return the base URL of an endpoint, without a trailing slash."""
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


class Address:
    """The base URL of an interface: ``bound``, the socket's, for clients whose Host field is no address."""

    def __init__(self, bound: str) -> None:
        self._bound = bound

    def __call__(self, request: Request) -> str:
        """Return the base URL, without a trailing slash."""
        host = request.headers.get(b"host", b"").decode("latin-1")
        return f"http://{host}" if _HOST.fullmatch(host) else self._bound
