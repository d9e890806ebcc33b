"""Where a service listens, as a value.

A URL may have a base-path prefix (a robot behind a gateway), an IPv6 literal and either scheme.
"""

import re
import ssl
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

from conformance.commandline.secret_file import IN_URL, names_user

DEFAULT_PORTS = {"http": 80, "https": 443}
_FORBIDDEN = re.compile(r"[\x00-\x20\x7f]")  # RFC 3986 section 2: neither space nor control characters


class EndpointError(ValueError):
    """Raised for a URL to which no request can be sent; the message contains the URL."""


@dataclass(frozen=True)
class Endpoint:
    """An HTTP origin with a path prefix.

    Attributes:
        scheme: `http` or `https`.
        host: name or address, without the brackets of an IPv6 literal.
        port: TCP port.
        path: prefix without a trailing slash; empty for none.
    """

    scheme: str
    host: str
    port: int
    path: str

    @classmethod
    def parse(cls, url: str, schemes: Mapping[str, int] = DEFAULT_PORTS) -> Self:
        """Read a URL of one of several schemes, which have their default ports.

        Raises:
            EndpointError: another scheme, no host, a port out of range, or user information in it.
        """
        if names_user(url):
            raise EndpointError(IN_URL)
        try:
            parts = urlsplit(url.strip())
            port = parts.port
        except ValueError as error:
            raise EndpointError(f"{url!r} is not a URL: {error}") from None
        if parts.scheme not in schemes:
            wanted = " or ".join(f"{name}://" for name in schemes)
            raise EndpointError(f"{url!r} does not begin with {wanted}")
        if not parts.hostname:
            raise EndpointError(f"{url!r} names no host")
        if _FORBIDDEN.search(parts.netloc + parts.path):
            raise EndpointError(f"{url!r} contains a space or a control character")
        return cls(
            parts.scheme, parts.hostname, schemes[parts.scheme] if port is None else port, parts.path.rstrip("/")
        )

    @property
    def origin(self) -> tuple[str, str, int]:
        """Return scheme, host and port (RFC 9110 section 4.3.1); a connection serves one origin."""
        return self.scheme, self.host, self.port

    @property
    def authority(self) -> str:
        """Return the Host header's value (RFC 9110 section 7.2), with the port unless it is the scheme's default."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return host if self.port == DEFAULT_PORTS.get(self.scheme) else f"{host}:{self.port}"

    @property
    def url(self) -> str:
        """Return the endpoint as a URL, without a trailing slash."""
        return f"{self.scheme}://{self.authority}{self.path}"


def tls_context(ca_file: Path | None) -> ssl.SSLContext:
    """Return a TLS context that checks certificate and host name; `ca_file` adds trusted authorities.

    Raises:
        EndpointError: `ca_file` cannot be read or contains no certificate.
    """
    try:
        return ssl.create_default_context(cafile=None if ca_file is None else str(ca_file))
    except OSError as error:  # ssl.SSLError is one
        raise EndpointError(f"ca_file {str(ca_file)!r}: {error}") from None
