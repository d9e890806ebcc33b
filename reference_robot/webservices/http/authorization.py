"""Bearer tokens (RFC 6750): with a token file, both interfaces ask for the token in it."""

import hmac
from pathlib import Path
from typing import Final

from reference_robot.webservices.representation.problems import Problem

_CHALLENGE: Final = ((b"www-authenticate", b'Bearer realm="robot"'),)
_INVALID: Final = ((b"www-authenticate", b'Bearer realm="robot", error="invalid_token"'),)


class TokenFileError(ValueError):
    """The token file cannot be used; the message says why."""


class Authorization:
    """Lets requests through that carry the token; all of them where there is none."""

    def __init__(self, token: str | None) -> None:
        self._token = None if token is None else token.encode()

    def check(self, headers: dict[bytes, bytes]) -> None:
        """Raise the 401 of RFC 9110 15.5.2 for a request without the token."""
        if self._token is None:
            return
        scheme, _, token = headers.get(b"authorization", b"").partition(b" ")
        if scheme.lower() != b"bearer":
            raise Problem(401, "this robot asks for a bearer token in the Authorization field", _CHALLENGE)
        if not hmac.compare_digest(token.strip(), self._token):
            raise Problem(401, "the bearer token in the Authorization field is not this robot's", _INVALID)


def read_token(path: Path) -> str:
    """Return the token that a file holds, without surrounding white space.

    Raises:
        TokenFileError: The file cannot be read, or holds anything but one word of printable ASCII.
    """
    try:
        token = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise TokenFileError(f"cannot read the token file {path}: {error}") from error
    if not token or not token.isprintable() or " " in token:
        raise TokenFileError(f"the token file {path} must hold one token of printable ASCII without spaces")
    return token
