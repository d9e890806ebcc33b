"""Access control by the head of a request: host name, bearer token and scope, and origin of a web page.

With a token file, REST and SOAP require a valid token (RFC 6750) with the necessary scope.
"""

import hmac
import re
from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Final

from conformance.commandline.secret_file import warn_if_shared
from reference_robot.webservices.http.hosts import AllowedHosts
from reference_robot.webservices.http.messages import Request
from reference_robot.webservices.representation.problems import Problem

_REALM: Final = b'Bearer realm="robot"'
_CHALLENGE: Final = ((b"www-authenticate", _REALM),)
_INVALID: Final = ((b"www-authenticate", _REALM + b', error="invalid_token"'),)

_TOKEN: Final = re.compile(r"[!-~]+")  # printable ASCII without spaces
_COMMENT: Final = "# "  # cannot be the start of a token, because tokens contain no space
SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS"})  # RFC 9110 9.2.1
_SHOWN: Final = 100  # characters of a client's text in error messages


class Scope(StrEnum):
    """The permissions that a token can have (RFC 6749 3.3)."""

    READ = "read"
    MOVE = "move"
    DELIVER = "deliver"


EVERYTHING: Final = frozenset(Scope)


class TokenFileError(ValueError):
    """An error for a token file that cannot be used; the message gives the reason."""


class Authorization:
    """The check of bearer tokens; without tokens every request is allowed.

    Attributes:
        is_required: Whether a token is required.
    """

    def __init__(self, tokens: Mapping[str, frozenset[Scope]] | None) -> None:
        self.is_required = tokens is not None
        self._tokens = [(token.encode(), scopes) for token, scopes in (tokens or {}).items()]

    def check(self, headers: dict[bytes, bytes], scope: Scope | None) -> None:
        """Raise the Problem 401 for a missing or unknown token (RFC 9110 15.5.2), or 403 for a token without the scope.

        Args:
            headers: Field values by lower-case name.
            scope: The scope that the request needs; None if any valid token is sufficient.
        """
        scheme, _, sent = headers.get(b"authorization", b"").partition(b" ")
        if scheme.lower() != b"bearer":
            raise Problem(401, "this robot requires a bearer token in the Authorization field", _CHALLENGE)
        sent, granted = sent.strip(), None
        for token, scopes in self._tokens:  # compare with all, so that the time reveals nothing
            if hmac.compare_digest(sent, token):
                granted = scopes
        if granted is None:
            raise Problem(401, "this robot does not know the bearer token in the Authorization field", _INVALID)
        if scope is not None and scope not in granted:
            challenge = _REALM + b', error="insufficient_scope", scope="%b"' % scope.encode()
            raise Problem(
                403,
                f"the request needs the scope {scope}; the bearer token has {' and '.join(sorted(granted))}",
                ((b"www-authenticate", challenge),),
            )


def read_tokens(path: Path) -> dict[str, frozenset[Scope]]:
    """Return the tokens of a file with their scopes.

    Each line has a token and its scopes, separated by white space: ``TOKEN read deliver``. A token without scopes has
    all of them. Empty lines, and lines that start with a hash and a space, are ignored.

    Raises:
        TokenFileError: The file cannot be read, or a line has another form. The message never quotes a line, which may
            contain a secret.
    """
    warn_if_shared(path, at_once=True)
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = "it is not ASCII" if isinstance(error, UnicodeDecodeError) else error
        raise TokenFileError(f"cannot read the token file {path}: {why}") from None
    tokens: dict[str, frozenset[Scope]] = {}
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith(_COMMENT):
            continue
        token, *scopes = line.split()
        if not _TOKEN.fullmatch(token) or not EVERYTHING.issuperset(scopes):
            raise TokenFileError(
                f"the token file {path}, line {number}, must have a token of printable ASCII and then its scopes, "
                f"of {', '.join(Scope)}; a token without scopes has all of them"
            )
        if token in tokens:
            raise TokenFileError(f"the token file {path}, line {number}, repeats a token")
        tokens[token] = frozenset(map(Scope, scopes)) or EVERYTHING
    if not tokens:
        raise TokenFileError(f"the token file {path} holds no token")
    return tokens


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
