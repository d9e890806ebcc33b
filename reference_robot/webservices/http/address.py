"""The base URL in descriptions and Location headers: the public URL, or the URL that the client used."""

from reference_robot.webservices.http.hosts import AUTHORITY
from reference_robot.webservices.http.messages import Request


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
