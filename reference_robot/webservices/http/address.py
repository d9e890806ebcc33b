"""The base URL that descriptions carry: the public one, or the one by which the client came."""

from reference_robot.webservices.http.hosts import AUTHORITY
from reference_robot.webservices.http.messages import Request


def url_of(host: str, port: int, scheme: str) -> str:
    """Return the base URL of an endpoint, without a trailing slash."""
    return f"{scheme}://[{host}]:{port}" if ":" in host else f"{scheme}://{host}:{port}"


class Address:
    """The base URL of an interface.

    Args:
        bound: The socket's own, for clients whose Host field is no address.
        public: The one that clients are told, whatever they asked; None where they are told what they asked.
    """

    def __init__(self, bound: str, public: str | None = None) -> None:
        self._bound = bound
        self._scheme = bound.partition(":")[0]
        self._public = public

    def __call__(self, request: Request) -> str:
        """Return the base URL, without a trailing slash."""
        if self._public is not None:
            return self._public
        host = request.authority.decode("latin-1")
        return f"{request.scheme or self._scheme}://{host}" if AUTHORITY.fullmatch(host) else self._bound

    def location(self, path: str) -> bytes:
        """Return the Location of a path (RFC 9110 10.2.2).

        It is relative to what the client asked, which is right behind every proxy but one that adds a path of its own.
        """
        return ((self._public or "") + path).encode()
