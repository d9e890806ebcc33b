"""Who is let in: requests for this robot, from no foreign page, with a token where tokens are asked for."""

from collections.abc import Iterable
from typing import Final, Protocol

from reference_robot.webservices.http.authorization import Authorization, Scope
from reference_robot.webservices.http.hosts import AllowedHosts
from reference_robot.webservices.http.messages import Request
from reference_robot.webservices.representation.problems import Problem

SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS"})  # RFC 9110 9.2.1

_SHOWN: Final = 100  # characters of a client's own word


class Scoped(Protocol):
    """What knows the scope that a request needs."""

    def needed(self, request: Request) -> Scope | None:
        """Return it; None for what any token may do."""


class Admission:
    """Judges a request by its head.

    Args:
        authorization: Who may do what.
        hosts: The names that the robot answers to.
        origins: Web origins (RFC 6454) whose pages may command the robot, besides the one that was asked.
    """

    def __init__(self, authorization: Authorization, hosts: AllowedHosts, origins: Iterable[str] = ()) -> None:
        self._authorization = authorization
        self._allows = hosts.allows
        self._origins = frozenset(origin.encode() for origin in origins)

    def check(self, request: Request, scoped: Scoped) -> None:
        """Raise the Problem 421, 401 or 403 for a request that is not let in."""
        if not self._allows(request.authority):
            host = request.authority.decode("latin-1")[:_SHOWN]
            raise Problem(421, f"this robot is not {host!a}; started with --allowed-host NAME, it answers to NAME too")
        if self._authorization.is_asked_for:
            self._authorization.check(request.headers, scoped.needed(request))
        if b"origin" in request.headers and request.method not in SAFE:
            self._require_own_origin(request)

    def _require_own_origin(self, request: Request) -> None:
        """Refuse what a page of another origin has a browser send: cross-site request forgery.

        Browsers ask before they send what this robot takes (PUT, DELETE, POST of text/xml), and get no leave. This
        holds where a browser, or something between, forgets to ask.
        """
        origin = request.headers[b"origin"]
        asked_by = origin.partition(b"://")[2].lower()  # nothing, where the origin is null
        if not (asked_by and asked_by == request.authority.lower()) and origin not in self._origins:
            told = origin.decode("latin-1")[:_SHOWN]
            raise Problem(403, f"a page of {told!a} may not command this robot; --public-url names the robot's own")
