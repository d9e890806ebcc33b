"""Credentials of requests: where each is sent, and which variable replaces its secret in findings.

A secret never leaves this module but in a request: ``str()`` and ``repr()`` of a credential show none, and a result has
the name of a shell variable (``$ROAAS_TOKEN``) where the secret was.
"""

from __future__ import annotations

import base64
import contextlib
import datetime as dt
import hashlib
import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from email.utils import parsedate_to_datetime
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Final
from urllib.parse import quote

from conformance.commandline.secrecy import SECRETS
from conformance.commandline.secret_file import read_secret

if TYPE_CHECKING:
    from conformance.transport.digest import DigestUser

# Shorter secrets are not searched for in responses, because they occur everywhere.
_SHORTEST: Final = 4
# Shorter cookie values are words, as in theme=dark, and are not masked.
_SHORTEST_IN_COOKIE: Final = 8
_VARIABLE: Final = re.compile(r"\$ROAAS_[A-Z0-9_]+")
# The head of a request, and the response to a challenge in it (RFC 7616 3.4).
_REQUEST_LINE: Final = re.compile(rb"(\S+) (\S+) HTTP/")
_ANSWER: Final = re.compile(r"(Authorization: Digest )[^\r\n]*")
_SHOWN_ANSWER: Final = re.compile(rb"Authorization: Digest \$ROAAS_DIGEST\r\n")
WRONG: Final = "roaas-not-this-one"
# Headers whose value begins with the name of a scheme (RFC 9110 11.6.2, 11.7.2); a pair in a Cookie header.
_AUTHORIZATION: Final = frozenset({"authorization", "proxy-authorization"})
_HEX: Final = re.compile(r"[0-9A-Fa-f-]+")
_COOKIE_VALUE: Final = re.compile(r"([^=;\s]+=)[^;]*")


class Kind(StrEnum):
    """Where a credential goes."""

    BEARER = "bearer"
    BASIC = "basic"
    DIGEST = "digest"
    HEADER = "header"
    QUERY = "query"
    COOKIE = "cookie"


# Kinds of which each is a whole header, unless the header is a cookie.
_PLAIN: Final = frozenset({Kind.BEARER, Kind.HEADER})


def _with_another_character(secret: str) -> str:
    """Return a secret with another character in its middle: of a signed token, not in bits that mean nothing."""
    middle = len(secret) // 2
    return secret[:middle] + ("1" if secret[middle : middle + 1] == "0" else "0") + secret[middle + 1 :]


# Changes that make a nearly right secret, by name, each with the text that is appended to the secret's variable.
_NEARLY: Final[dict[str, tuple[Callable[[str], str], str]]] = {
    "": (str, ""),
    "lengthened": (lambda secret: f"{secret}-{WRONG}", f"-{WRONG}"),
    "shortened": (lambda secret: secret[:-1], "_SHORTENED"),
    "altered": (_with_another_character, "_ALTERED"),
    # Hexadecimal digits mean the same in both cases.
    "recased": (lambda secret: secret if _HEX.fullmatch(secret) else secret.swapcase(), "_RECASED"),
    "emptied": (lambda _: "", "_EMPTIED"),
    "schemed": (str, ""),
}


@dataclass(frozen=True)
class Credential:
    """One credential.

    Attributes:
        kind: where it goes.
        secret: the token, the key, the header's value, or ``user:password`` for ``basic`` and ``digest``.
        name: the name of the header, the query parameter or the cookie; empty for the others.
        near: how the sent text differs from the secret, so that no robot knows it; empty if it does not.
    """

    kind: Kind
    secret: str = field(repr=False)
    name: str = ""
    near: str = ""

    def __post_init__(self) -> None:
        if WRONG not in self.secret:
            for secret in filter(None, (self.as_sent,) if self.near else self.secrets):
                SECRETS.keep(secret, self.variable)

    @property
    def variable(self) -> str:
        """The shell variable that stands for the sent text, with its dollar sign; the text itself where it is wrong."""
        if WRONG in self.secret:
            return self.as_sent
        own = {Kind.BEARER: "TOKEN", Kind.BASIC: "BASIC", Kind.DIGEST: "DIGEST"}.get(self.kind)
        name = own or re.sub("[^A-Z0-9]", "_", f"{self.kind}_{self.name}".upper())
        return f"$ROAAS_{name}{_NEARLY[self.near][1]}"

    @property
    def as_sent(self) -> str:
        """Return the secret in the form in which a request carries it."""
        if self.kind is Kind.BASIC:
            return base64.b64encode(self.secret.encode()).decode()
        return quote(self.secret, safe="") if self.kind is Kind.QUERY else _NEARLY[self.near][0](self.secret)

    @property
    def header(self) -> str:
        """Name of the header that it goes into; empty for a query parameter."""
        named = {Kind.HEADER: self.name, Kind.COOKIE: "Cookie", Kind.QUERY: ""}
        return named.get(self.kind, "Authorization")

    def value(self, text: str) -> str:
        """Return the header's value, or the query, with ``text`` for the secret."""
        forms = {
            Kind.BEARER: f"{'Token' if self.near == 'schemed' else 'Bearer'} {text}".rstrip(),
            Kind.BASIC: f"Basic {text}",
            Kind.DIGEST: f"Digest {text}",
            Kind.HEADER: text,
        }
        return forms.get(self.kind, f"{self.name}={text}")

    @property
    def wrong(self) -> Credential:
        """The same credential with a secret that no robot knows; the scheme of an Authorization header is kept."""
        secret = f"{WRONG}:x" if self.kind in {Kind.BASIC, Kind.DIGEST} else WRONG
        if self.kind is Kind.HEADER and self.name.lower() == "cookie":
            secret = _COOKIE_VALUE.sub(rf"\1{WRONG}", self.secret)
        return Credential(self.kind, f"{self.scheme} {secret}".lstrip(), self.name)

    @property
    def scheme(self) -> str:
        """The authentication scheme in the value of an Authorization header that was given whole; else empty."""
        is_whole = self.kind is Kind.HEADER and self.name.lower() in _AUTHORIZATION
        return self.secret.rpartition(" ")[0].partition(" ")[0] if is_whole else ""

    @property
    def secrets(self) -> tuple[str, ...]:
        """The texts that must not be shown, the longest first."""
        parts = [self.secret.removeprefix(self.scheme).lstrip()]
        if self.kind in {Kind.BASIC, Kind.DIGEST}:
            parts += self.secret.split(":", 1)[1:]
        if self.scheme.lower() == "basic":
            with contextlib.suppress(ValueError):
                parts += base64.b64decode(parts[0]).decode("utf-8", "replace").split(":", 1)[1:]
        if self.kind is Kind.HEADER and self.header.lower() == "cookie":
            values = (pair.partition("=")[2] for pair in self.secret.split("; "))
            parts += [value for value in values if len(value) >= _SHORTEST_IN_COOKIE]
        return tuple(sorted({self.as_sent, self.secret, *parts}, key=len, reverse=True))

    @property
    def places(self) -> tuple[tuple[str, str], ...]:
        """Return the credential's places as descriptions name them: header, query or cookie, and its name."""
        if self.kind in {Kind.QUERY, Kind.COOKIE}:
            return ((str(self.kind), self.name),)
        if self.header.lower() == "cookie":
            return tuple(("cookie", found[1].rstrip("=")) for found in _COOKIE_VALUE.finditer(self.secret))
        return (("header", self.header.lower()),)

    @cached_property
    def digest(self) -> DigestUser:
        """Return the user of a ``digest`` credential, who keeps the device's challenge."""
        # Imported late: requests takes a twentieth of a second.
        from conformance.transport.digest import DigestUser  # noqa: PLC0415

        return DigestUser(self.secret)


@dataclass(frozen=True)
class Credentials:
    """All credentials of a run.

    Attributes:
        items: each goes into every request.
    """

    items: tuple[Credential, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.items)

    def add_to(
        self, fields: Sequence[tuple[str, str]], method: str = "GET", target: str = "/", *, shown: bool = False
    ) -> list[tuple[str, str]]:
        """Return a request's headers with the credentials; cookies join those of the request (RFC 6265 5.4)."""
        names = [name for name, _ in fields if name.lower() != "cookie"]
        more = self.fields(method, target, names, shown=shown)
        cookies = "; ".join(value for name, value in more if name.lower() == "cookie")
        found = [
            (name, f"{value}; {cookies}" if cookies and name.lower() == "cookie" else value) for name, value in fields
        ]
        joined = len(names) < len(fields)
        return [*found, *(pair for pair in more if not (joined and pair[0].lower() == "cookie"))]

    def fields(
        self, method: str = "GET", target: str = "/", given: Iterable[str] = (), *, shown: bool = False
    ) -> list[tuple[str, str]]:
        """Return the headers to add to a request.

        Args:
            method: the method of the request.
            target: its request target.
            given: names of headers that the request has already: they are left as they are.
            shown: with variables in place of the secrets.
        """
        there = {name.lower() for name in given}
        found: dict[str, str] = {}
        for item in self.items:
            if item.header and item.header.lower() not in there:
                value = item.value(item.variable if shown else item.as_sent)
                if item.kind is Kind.DIGEST and not shown:
                    value = item.digest.answer(method, target)
                    if not value:
                        continue
                # Cookies share one header (RFC 6265 5.4); of other headers with one name, the last counts.
                together = item.kind is Kind.COOKIE and item.header in found
                found[item.header] = f"{found[item.header]}; {value}" if together else value
        return list(found.items())

    def learn(self, headers: Iterable[tuple[str, str]]) -> bool:
        """Take the challenge of a 401 response; return whether the request can be sent again with an answer to it."""
        return any(item.kind is Kind.DIGEST and item.digest.learn(headers) for item in self.items)

    @property
    def awaits_challenge(self) -> bool:
        """Whether nothing can be sent with digest authentication yet, as the device has sent no challenge."""
        return any(item.kind is Kind.DIGEST and not item.digest.answer("GET", "/") for item in self.items)

    @property
    def repeats_target(self) -> bool:
        """Whether a header has the request target once more (RFC 7616 3.4)."""
        return any(item.kind is Kind.DIGEST for item in self.items)

    def target(self, target: str, *, shown: bool = False) -> str:
        """Return a request target with the credentials that go into the query."""
        queries = [item.value(item.variable if shown else item.as_sent) for item in self.items if not item.header]
        return target + "".join(f"{'&' if '?' in target or number else '?'}{one}" for number, one in enumerate(queries))

    def hide(self, text: str) -> str:
        """Return a text with variables in place of secrets, in whatever form a robot repeats them."""
        if any(item.kind is Kind.DIGEST for item in self.items):
            text = _ANSWER.sub(r"\1$ROAAS_DIGEST", text)
        for item in self.items:
            for secret in item.secrets:
                if len(secret) >= _SHORTEST:
                    text = text.replace(secret, item.variable)
        return text

    def hidden_bytes(self, octets: bytes) -> bytes:
        """Return bytes with variables in place of secrets."""
        return self.hide(octets.decode("latin-1")).encode("latin-1", "replace") if self.items else octets

    def reveal(self, octets: bytes) -> bytes:
        """Return bytes with the secrets in place of variables, to send a recorded request again."""
        # Longest first, because one variable's name may begin another's.
        for item in sorted(self.items, key=lambda item: -len(item.variable)):
            if item.kind is Kind.DIGEST and (line := _REQUEST_LINE.match(octets)):
                answer = item.digest.answer(line[1].decode("latin-1"), line[2].decode("latin-1"))
                field = f"Authorization: {answer}\r\n".encode("latin-1") if answer else b""
                octets = _SHOWN_ANSWER.sub(lambda _, field=field: field, octets)  # type: ignore[misc] # a default
            octets = octets.replace(item.variable.encode(), item.as_sent.encode("latin-1"))
        return octets

    @property
    def places(self) -> tuple[tuple[str, str], ...]:
        """Where they go, as a description names that."""
        return tuple(place for item in self.items for place in item.places)

    @property
    def wrong(self) -> Credentials:
        """The same credentials with secrets that no robot knows."""
        return Credentials(tuple(item.wrong for item in self.items))

    @property
    def nearly(self) -> tuple[Credentials, ...]:
        """The same credentials, each token and key nearly right in one way; none if there are others than these."""
        is_plain = bool(self) and all(item.kind in _PLAIN and not item.scheme for item in self.items)
        found = [tuple(replace(item, near=text) for item in self.items) for text in (_NEARLY if is_plain else ())]
        return tuple(
            Credentials(items)
            for items in found
            if all(one.value(one.as_sent) != own.value(own.as_sent) for one, own in zip(items, self.items, strict=True))
        )


def bearer(token: str) -> Credential:
    """Return the credential for a bearer token (RFC 6750)."""
    return Credential(Kind.BEARER, token)


def is_shown(value: str) -> bool:
    """Return whether a header's value in a recorded request stands for a credential."""
    return _VARIABLE.search(value) is not None


def quoted(word: str) -> str | None:
    """Return a shell word in which credentials' variables are expanded; None if it has none."""
    if not is_shown(word):
        return None
    parts = re.split(f"({_VARIABLE.pattern})", word)
    # An interactive shell replaces "!" in double quotes.
    escaped = [part if odd % 2 else re.sub(r'([\\"$`])', r"\\\1", part) for odd, part in enumerate(parts)]
    return '"' + "".join(part.replace("!", "\"'!'\"") for part in escaped) + '"'


# Placeholders for the texts that differ in each message.
_VARIABLES: Final = (b"$WSSE_DIGEST", b"$WSSE_NONCE", b"$WSSE_CREATED")
# The headers in which these texts stand.
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

    def reveal(self, octets: bytes) -> bytes:
        """Return a request with a fresh token in place of the variables of hide_token(); its length stays the same."""
        for variable, text in zip(_VARIABLES, self.fresh(), strict=True):
            octets = octets.replace(variable, text.encode())
        return octets


def hide_token(octets: bytes) -> bytes:
    """Return a request with variables in place of the texts that differ in each token."""
    return _TOKEN.sub(b"".join(b"\\%d%b" % (part, name) for part, name in enumerate(_VARIABLES, 1)), octets, count=1)


def _text(octets: bytes) -> str:
    return base64.b64encode(octets).decode()
