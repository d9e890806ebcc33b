"""Access control by the head of a request: host name, bearer token and scope, and origin of a web page."""

from collections.abc import Callable, Iterable
from typing import Final

from reference_robot.webservices.http.authorization import Authorization, Scope
from reference_robot.webservices.http.hosts import AllowedHosts
from reference_robot.webservices.http.messages import Request
from reference_robot.webservices.representation.problems import Problem

SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS"})  # RFC 9110 9.2.1

_SHOWN: Final = 100  # characters of a client's text in error messages


class Admission:
    """The access check for the head of every request.

    Args:
        authorization: The valid tokens and their scopes.
        hosts: The host names by which clients may address the robot.
        origins: Web origins (RFC 6454), besides the robot's own, whose pages may send commands to the robot.
    """

    def __init__(self, authorization: Authorization, hosts: AllowedHosts, origins: Iterable[str] = ()) -> None:
        self._authorization = authorization
        self._allows = hosts.allows
        self._origins = frozenset(origin.encode() for origin in origins)

    @property
    def is_guarded(self) -> bool:
        """Whether requests need a token."""
        return self._authorization.is_required

    def check(self, request: Request, needed: Callable[[Request], Scope | None]) -> None:
        """Raise the Problem 421, 401 or 403 for a request with a wrong host, token or origin.

        ``needed`` returns the scope that a request needs; None if any valid token is sufficient.
        """
        if not self._allows(request.authority):
            host = request.authority.decode("latin-1")[:_SHOWN]
            raise Problem(421, f"this robot is not {host!a}; to allow another NAME, start it with --allowed-host NAME")
        if self._authorization.is_required:
            self._authorization.check(request.headers, needed(request))
        if b"origin" in request.headers and request.method not in SAFE:
            self._require_own_origin(request)

    def _require_own_origin(self, request: Request) -> None:
        """Raise the Problem 403 for a command from a web page of another origin (cross-site request forgery).

        Browsers send a preflight request before PUT, DELETE and POST of text/xml, and get no permission. This check
        also stops browsers or intermediaries that omit the preflight.
        """
        origin = request.headers[b"origin"]
        page_host = origin.partition(b"://")[2].lower()  # empty if the origin is null
        if not (page_host and page_host == request.authority.lower()) and origin not in self._origins:
            page = origin.decode("latin-1")[:_SHOWN]
            raise Problem(403, f"a page of {page!a} may not command this robot; --public-url sets the robot's origin")
