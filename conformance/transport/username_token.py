"""WS-Security's UsernameToken with a password digest (OASIS UsernameToken Profile 1.0, 3.1)."""

from __future__ import annotations

import base64
import datetime as dt
import hashlib
import os
import re
from dataclasses import dataclass, field
from email.utils import parsedate_to_datetime
from typing import Final

from conformance.commandline.secrecy import SECRETS
from conformance.commandline.secret_file import read_secret

# What stands in a request for the texts that each message has of its own, and where they are.
_VARIABLES: Final = (b"$WSSE_DIGEST", b"$WSSE_NONCE", b"$WSSE_CREATED")
_TOKEN: Final = re.compile(rb"(:Password [^>]*>)[^<]*(<.*?:Nonce [^>]*>)[^<]*(<.*?:Created>)[^<]*", re.DOTALL)


@dataclass
class UsernameToken:
    """A user whose token each message carries.

    Attributes:
        user: name.
        password: never sent, only a digest of it.
        ahead: how far the device's clock is ahead of ours.
    """

    user: str
    password: str = field(repr=False)
    ahead: dt.timedelta = dt.timedelta()

    def __post_init__(self) -> None:
        SECRETS.keep(self.password, "$ROAAS_USERNAME_TOKEN")

    @classmethod
    def of(cls, path: str | None) -> UsernameToken | None:
        """Return the user in a file with ``user:password``; None without a file.

        Raises:
            OSError, ValueError: the file cannot be read, or has no such line.
        """
        if path is None:
            return None
        user, colon, password = read_secret(path).partition(":")
        if not colon:
            raise ValueError(f"{path}: expected one line user:password")
        return cls(user, password)

    def set_clock(self, date: str | None) -> None:
        """Take the device's time from a Date header: a device that is an hour off refuses tokens of another time."""
        if date is not None:
            self.ahead = parsedate_to_datetime(date) - dt.datetime.now(dt.UTC)

    def fresh(self) -> tuple[str, str, str]:
        """Return the texts of a token that no message has carried: password digest, nonce, and time of creation."""
        nonce = os.urandom(16)
        created = (dt.datetime.now(dt.UTC) + self.ahead).strftime("%Y-%m-%dT%H:%M:%SZ")
        digest = hashlib.sha1(nonce + created.encode() + self.password.encode(), usedforsecurity=False).digest()
        return _text(digest), _text(nonce), created

    def revealed(self, octets: bytes) -> bytes:
        """Return a request with a fresh token where hidden() has left variables; its length stays as it was."""
        for variable, text in zip(_VARIABLES, self.fresh(), strict=True):
            octets = octets.replace(variable, text.encode())
        return octets


def hidden(octets: bytes) -> bytes:
    """Return a request with variables in place of what is fresh in each token."""
    return _TOKEN.sub(b"".join(b"\\%d%b" % (part, name) for part, name in enumerate(_VARIABLES, 1)), octets, count=1)


def _text(octets: bytes) -> str:
    return base64.b64encode(octets).decode()
