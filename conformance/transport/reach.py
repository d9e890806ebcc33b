"""What a description may reach: the user's servers, and files in its own folder.

A description decides neither where credentials go nor what is read. Names are compared, not addresses: 127.0.0.1 and
localhost are two servers. A request to a named server always goes to the name as the user wrote it.
"""

import ipaddress
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Self
from urllib.parse import urljoin, urlsplit, urlunsplit

from conformance.commandline.device_options import advice

#: The port of a scheme where a URL names none.
PORTS: Final = {"http": 80, "https": 443}
_BLANK: Final = re.compile(r"[\x00-\x20\x7f]")
_NAME: Final = re.compile(r"[a-z0-9._~-]+")
_SCHEME: Final = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")
# Names of this machine. They count as different hosts, because one may be forwarded elsewhere.
_HERE: Final = frozenset({"localhost", "127.0.0.1", "::1"})
_MOST_OCTETS: Final = 32 * 1024 * 1024


class ElsewhereError(ValueError):
    """Raised instead of a request to a server, or of reading a file, that the user did not name."""


class UnreachableError(Exception):
    """Raised when a description's server does not respond; the message explains why."""


class Origin(NamedTuple):
    """Scheme, host and port in the normal form for comparison (RFC 6454 4)."""

    scheme: str
    host: str
    port: int

    @classmethod
    def of(cls, url: str) -> Self:
        """Return the origin of a URL, whatever user it names.

        Raises:
            ValueError: it is no http or https URL, or different readers could see different hosts in it.
        """
        parts = urlsplit(url)
        if _BLANK.search(parts.netloc) or "\\" in parts.netloc or not parts.hostname or parts.scheme not in PORTS:
            raise ValueError(f"{url[:200]!r} is no http or https URL")
        return cls(parts.scheme, host_of(parts.hostname), PORTS[parts.scheme] if parts.port is None else parts.port)


def host_of(name: str) -> str:
    """Return a host's name or address in the normal form for comparison.

    Raises:
        ValueError: it is none.
    """
    if ":" in name:
        address, _, zone = name.strip("[]").replace("%25", "%", 1).partition("%")
        return f"{ipaddress.IPv6Address(address).compressed}%{zone}".rstrip("%")
    plain = name.encode("idna").decode("ascii").lower().removesuffix(".")
    if not _NAME.fullmatch(plain):
        raise ValueError(f"{name[:200]!r} is no host")
    return plain


def trusted_host(text: str) -> tuple[str, int | None]:
    """Return host and port of ``HOST[:PORT]``; without a port, None: each port of the host.

    Raises:
        ValueError: it is neither.
    """
    parts = urlsplit(f"//{text}")
    if not parts.hostname or parts.netloc != text or "@" in text or "\\" in text or _BLANK.search(text):
        raise ValueError(f"{text[:200]!r} is no HOST or HOST:PORT")
    return host_of(parts.hostname), parts.port


@dataclass(frozen=True)
class Trust:
    """The servers to which a run's credentials may go.

    Attributes:
        named: the URLs that the user named.
        hosts: ``HOST[:PORT]`` of each --trust-host.
    """

    named: tuple[str, ...] = ()
    hosts: tuple[str, ...] = ()

    @classmethod
    def of(cls, *named: str | None, hosts: Iterable[str] = ()) -> Self:
        """Return the trust in the servers of those of these sources that are URLs.

        Raises:
            ValueError: a host is no HOST[:PORT].
        """
        hosts = tuple(hosts)
        for host in hosts:
            trusted_host(host)
        return cls(tuple(text for text in named if text and text.lower().startswith(("http://", "https://"))), hosts)

    def refusal(self, url: str) -> str:
        """Return why a URL that a description names is not used, or an empty text."""
        try:
            wanted, netloc = Origin.of(url), urlsplit(url).netloc
        except ValueError as error:
            return str(error) or f"{url[:200]!r} is no URL"
        known = [(Origin.of(text), urlsplit(text).netloc) for text in self.named]
        if "@" in netloc and netloc not in {named for _, named in known}:
            return "a URL in a description must not name a user"
        if any(wanted == one for one, _ in known):
            return ""
        if wanted.scheme == "http" and known and all(one.scheme == "https" for one, _ in known):
            return "it is http, and what was named is https"
        if (wanted.host, wanted.port) in self._hosts or (wanted.host, None) in self._hosts:
            return ""
        flag = f"[{wanted.host}]" if ":" in wanted.host else wanted.host
        alike = next((one.host for one, _ in known if {one.host, wanted.host} <= _HERE and one.host != wanted.host), "")
        names = f", as {alike} and {wanted.host} are different names" if alike else ""
        return f"it is on another server{names}" + advice(f"; --trust-host {flag}:{wanted.port} allows that")

    def trusts(self, url: str) -> bool:
        """Return whether a URL is on a server to which credentials may go."""
        return not self.refusal(url)

    def place(self, url: str) -> str:
        """Return a URL on a trusted server with scheme, host and port as the user wrote them, without a user.

        Raises:
            ElsewhereError: it is on no such server.
        """
        if reason := self.refusal(url):
            raise ElsewhereError(reason)
        parts = urlsplit(url)
        own = next((urlsplit(text) for text in self.named if Origin.of(text) == Origin.of(url)), parts)
        return urlunsplit((own.scheme, own.netloc.rpartition("@")[2], parts.path or "/", parts.query, ""))

    @property
    def _hosts(self) -> set[tuple[str, int | None]]:
        return {trusted_host(host) for host in self.hosts}


def is_same(one: str, other: str) -> bool:
    """Return whether two URLs have the same scheme, host and port."""
    try:
        return Origin.of(one) == Origin.of(other)
    except ValueError:
        return False


def joined(base: str, reference: str) -> str:
    """Return a reference as a URL; a text that is no reference unchanged."""
    try:
        return urljoin(base, reference)
    except ValueError:
        return reference


def path_of(url: str) -> str:
    """Return the path of a URL; an empty text if it is no URL."""
    try:
        return urlsplit(url).path
    except ValueError:
        return ""


def server_of(url: str) -> str:
    """Return scheme, host and port of a URL as they are written."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc}"


def split(url: str) -> tuple[str, str]:
    """Return scheme and host without credentials, and path with query."""
    parts = urlsplit(url)
    query = f"?{parts.query}" if parts.query else ""
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}", f"{parts.path or '/'}{query}"


def at_server(url: str, old: str, new: str) -> str:
    """Return a URL of the server ``old`` with another scheme and host: a device behind a front does not know its own.

    A URL of any other server is returned as it is.
    """
    return new.rstrip("/") + url[len(server_of(url)) :] if is_same(url, old) else url


@dataclass(frozen=True)
class Folder:
    """The files that a description may refer to.

    Attributes:
        source: the description; that of a server may refer to no file.
        named: further files and folders that the user named.
        anywhere: whether it may refer to any file (--allow-files).
    """

    source: str
    named: tuple[str, ...] = ()
    anywhere: bool = False

    def read(self, path: str) -> bytes:
        """Return the content of a file.

        Raises:
            ElsewhereError: the description must not refer to it.
            OSError, ValueError: it cannot be read.
        """
        file = Path(path)
        if path != self.source and not self._is_named(file):
            if "://" in self.source:
                raise ElsewhereError("the description of a server refers to no file")
            if _SCHEME.match(path) or path.startswith(("\\\\", "//")):
                raise ElsewhereError("it is neither a file nor a URL of a server")
            folder = Path(self.source).parent
            if not self.anywhere and not _is_inside(file, folder):
                raise ElsewhereError(
                    f"it is outside the description's folder {folder}" + advice("; --allow-files allows that")
                )
        if file.exists() and not file.is_file():
            raise ValueError("it is no file")
        with file.open("rb") as opened:
            octets = opened.read(_MOST_OCTETS + 1)
        if len(octets) > _MOST_OCTETS:
            raise ValueError(f"it has more than {_MOST_OCTETS:,} bytes")
        return octets

    def _is_named(self, file: Path) -> bool:
        return any(file == Path(text) or (Path(text).is_dir() and _is_inside(file, Path(text))) for text in self.named)


def _is_inside(file: Path, folder: Path) -> bool:
    """Return whether a file is in a folder or below it, wherever symbolic links lead."""
    return file.resolve().is_relative_to(folder.resolve())
