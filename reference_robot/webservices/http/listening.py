"""The network settings of the robot: addresses, host names, public URLs, proxies, tokens and TLS."""

import ipaddress
import ssl
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final
from urllib.parse import urlsplit

from reference_robot.webservices.http.access import Admission, Authorization
from reference_robot.webservices.http.hosts import AllowedHosts, TrustedProxies, is_host_pattern, is_loopback, own_names

REST: Final = "rest"
SOAP: Final = "soap"


class ListeningError(ValueError):
    """An error in a network option; the message names the option and a remedy."""


@dataclass(frozen=True)
class Listening:
    """The addresses to bind and the rules for access; port 0 selects a free port.

    Attributes:
        public_urls: Base URLs given to clients, by interface, without a trailing slash.
        allowed_hosts: Names that clients may use, besides the robot's own.
        tls: The TLS settings for HTTPS; None for HTTP.
    """

    host: str
    rest_port: int
    soap_port: int
    authorization: Authorization
    allowed_hosts: tuple[str, ...] = ()
    public_urls: Mapping[str, str] = field(default_factory=dict)
    proxies: TrustedProxies = field(default_factory=TrustedProxies)
    tls: ssl.SSLContext | None = None

    @property
    def scheme(self) -> str:
        """The scheme of the URLs at which the robot listens."""
        return "http" if self.tls is None else "https"

    def admission(self) -> Admission:
        """Return the access check for requests."""
        public = [urlsplit(url) for url in self.public_urls.values()]
        named = [self.host, *own_names(), *(url.hostname or "" for url in public), *self.allowed_hosts]
        return Admission(
            self.authorization,
            AllowedHosts(name for name in named if name),
            {f"{url.scheme}://{url.netloc}" for url in public},
        )


def require_guarded(host: str, authorization: Authorization) -> None:
    """Raise the ListeningError if other machines could command the robot without a token."""
    if not authorization.is_required and not is_loopback(host):
        raise ListeningError(
            f"--host {host} would let everybody on its network drive this robot without a token: "
            "give --token-file FILE, or --insecure to allow that"
        )


def host_patterns(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of ``--allowed-host``; raise the ListeningError for an invalid name."""
    allowed = tuple(names)
    for name in allowed:
        if not is_host_pattern(name):
            raise ListeningError(
                f"--allowed-host {name!a} must be a name without scheme and port, such as robot.example.org; "
                ".example.org stands for all names below it, * for any (addresses are always allowed)"
            )
    return allowed


def public_urls(given: Iterable[str]) -> dict[str, str]:
    """Return the base URL of each interface from values such as ``URL`` (for both), ``rest=URL`` and ``soap=URL``.

    Raises:
        ListeningError: A value is not an HTTP base URL, or an interface has two URLs.
    """
    urls: dict[str, str] = {}
    for text in given:
        name, equals, url = text.partition("=")
        interfaces = (name,) if equals and name in {REST, SOAP} else (REST, SOAP)
        url = url if len(interfaces) == 1 else text
        if not _is_base_url(url):
            raise ListeningError(
                f"--public-url {text!a} must be [rest=|soap=]http(s)://HOST[:PORT][/PATH], without query or fragment"
            )
        for interface in interfaces:
            if interface in urls:
                raise ListeningError(f"--public-url {text!a}: {interface} has {urls[interface]} already")
            urls[interface] = url.rstrip("/")
    return urls


def trusted_proxies(given: Iterable[str]) -> TrustedProxies:
    """Return the proxies of ``--trusted-proxy``; raise the ListeningError for an invalid address or network."""
    networks = []
    for text in given:
        try:
            networks.append(ipaddress.ip_network(text))
        except ValueError as error:
            raise ListeningError(
                f"--trusted-proxy {text!a} must be an address or a network such as 10.0.0.0/8: {error}"
            ) from error
    return TrustedProxies(networks)


def _is_base_url(text: str) -> bool:
    try:
        url = urlsplit(text)
        url.port  # noqa: B018 - raises for an invalid port
    except ValueError:
        return False
    return (
        url.scheme in {"http", "https"} and bool(url.hostname) and not (url.query or url.fragment or "@" in url.netloc)
    )
