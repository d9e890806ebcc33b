"""WS-Security's UsernameToken with a password digest (OASIS UsernameToken Profile 1.0, 3.1)."""

from __future__ import annotations

import base64
import datetime as dt
import hashlib
import os
from dataclasses import dataclass, field
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Final

from conformance.documents.xml_names import clark
from conformance.documents.xml_node import Node

_WSS: Final = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-"
_SECURITY: Final = f"{_WSS}wssecurity-secext-1.0.xsd"
_UTILITY: Final = f"{_WSS}wssecurity-utility-1.0.xsd"
_DIGEST: Final = f"{_WSS}username-token-profile-1.0#PasswordDigest"
_BASE64: Final = f"{_WSS}soap-message-security-1.0#Base64Binary"


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

    @classmethod
    def of(cls, path: str | None) -> UsernameToken | None:
        """Return the user in a file with ``user:password``; None without a file.

        Raises:
            OSError, ValueError: the file cannot be read, or has no such line.
        """
        if path is None:
            return None
        user, colon, password = Path(path).read_text(encoding="utf-8").strip().partition(":")
        if not colon:
            raise ValueError(f"{path}: expected one line user:password")
        return cls(user, password)

    def set_clock(self, date: str | None) -> None:
        """Take the device's time from a Date header: a device that is an hour off refuses tokens of another time."""
        if date is not None:
            self.ahead = parsedate_to_datetime(date) - dt.datetime.now(dt.UTC)

    def block(self, envelope: str) -> Node:
        """Return a header block with a fresh nonce, for an Envelope of that namespace."""
        nonce = os.urandom(16)
        created = (dt.datetime.now(dt.UTC) + self.ahead).strftime("%Y-%m-%dT%H:%M:%SZ")
        digest = hashlib.sha1(nonce + created.encode() + self.password.encode(), usedforsecurity=False).digest()
        token = Node(
            clark(_SECURITY, "UsernameToken"),
            children=(
                Node(clark(_SECURITY, "Username"), self.user),
                Node(clark(_SECURITY, "Password"), _text(digest), (), (("Type", _DIGEST),)),
                Node(clark(_SECURITY, "Nonce"), _text(nonce), (), (("EncodingType", _BASE64),)),
                Node(clark(_UTILITY, "Created"), created),
            ),
        )
        return Node(clark(_SECURITY, "Security"), "", (token,), ((clark(envelope, "mustUnderstand"), "1"),))


def _text(octets: bytes) -> str:
    return base64.b64encode(octets).decode()
