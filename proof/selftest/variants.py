"""Variants of a good device that must stay conformant: TLS, path prefix, authentication, rate limits, slow links."""

import base64
import json
import shutil
import ssl
import subprocess
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any

from conformance.contract.pack import Contract
from proof.mutation.changes import JSON, parsed, problem
from proof.mutation.messages import Change, Forward, Request, Response, unchanged
from proof.mutation.self_test import self_test_of
from proof.selftest.link import LINKS, Link

_PREFIX = "/r2d2/api"
_SECRET = "open-sesame"  # noqa: S105 - of a robot that lives for seconds, on loopback
_BASIC = f"robot:{_SECRET}"
_DELAY_S = 0.3
_CEILING = 100.0


@dataclass(frozen=True)
class Variant:
    """One variant: a link, proxy or option between a good device and its clients.

    Attributes:
        name: its name.
        says: a short description.
        make: returns the change to the device's messages.
        host: address on which the proxy listens.
        prefix: path before every REST path.
        tls: whether the proxy speaks TLS.
        secrets: contents of the files with credentials that clients must send, by the endpoint option of the statement.
        endpoints: additional endpoint options of the statement.
        link: the simulated network link between clients and proxy, or None for none.
    """

    name: str
    says: str
    make: Callable[[], Change] = lambda: unchanged
    host: str = "127.0.0.1"
    prefix: str = ""
    tls: bool = False
    secrets: dict[str, str] = field(default_factory=dict)
    endpoints: dict[str, Any] = field(default_factory=dict)
    link: Link | None = None


class CertificateError(Exception):
    """No TLS certificate can be made on this machine."""


def certificate(folder: Path) -> tuple[ssl.SSLContext, Path]:
    """Return a TLS context with a new self-signed certificate, and the file with which clients trust it.

    Raises:
        CertificateError: openssl is missing or fails.
    """
    openssl = shutil.which("openssl")
    if openssl is None:
        raise CertificateError("there is no openssl to make a certificate with")
    key, cert = folder / "key.pem", folder / "cert.pem"
    names = "subjectAltName=IP:127.0.0.1,IP:::1,DNS:localhost"
    command = [openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=robot"]
    command += ["-addext", names, "-keyout", str(key), "-out", str(cert)]
    done = subprocess.run(command, capture_output=True, check=False)  # noqa: S603 - made above
    if done.returncode:
        raise CertificateError(f"openssl fails: {done.stderr.decode(errors='replace')[-200:]}")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(cert, key)
    return context, cert


def _slow(request: Request, forward: Forward) -> Response:
    time.sleep(_DELAY_S)
    return forward(request)


def _add_prefix(request: Request, forward: Forward) -> Response:
    """Add the path prefix to the server URL in the OpenAPI description."""
    response = forward(request)
    if request.side == "rest" and request.path.endswith("/openapi.json"):
        if request.method == "HEAD":
            # The length was that of the description before the prefix was added.
            response.drop("Content-Length")
        value = parsed(response.body)
        if isinstance(value, dict):
            response.body = json.dumps({**value, "servers": [{"url": _PREFIX}]}).encode()
    return response


def _closing(request: Request, forward: Forward) -> Response:
    response = forward(request)
    response.version = "HTTP/1.0"
    response.put("Connection", "close")
    return response


def _require_field(name: str, value: str, scheme: str) -> Callable[[], Change]:
    """Return a change that responds 401 to every request without a header of this value (RFC 9110 15.5.2)."""

    def change(request: Request, forward: Forward) -> Response:
        if request.raw is None and request.field(name) != value:
            return problem(401, f"{name} is required", ("WWW-Authenticate", f'{scheme} realm="robot"'))(request)
        return forward(request)

    return lambda: change


class _Ceiling:
    """A rate limit: responds 429 to requests beyond a number per second."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._lock = threading.Lock()

    def __call__(self, request: Request, forward: Forward) -> Response:
        now = time.monotonic()
        with self._lock:
            self._times = [*(one for one in self._times if now - one < 1.0), now]
            # A tenth above the limit, because clients' clocks and scheduling vary.
            full = len(self._times) > _CEILING * 1.1
        if full:
            return problem(429, "too many requests", ("Retry-After", "1"))(request)
        return forward(request)


def _uptime(request: Request, forward: Forward) -> Response:
    """Add the robot's uptime in seconds to every JSON object."""
    response = forward(request)
    if request.side != "rest" or response.status != HTTPStatus.OK or response.media_type != JSON:
        return response
    value = parsed(response.body)
    if request.method == "HEAD":
        response.drop("Content-Length")
    elif isinstance(value, dict) and "openapi" not in value:
        response.body = json.dumps({**value, "uptime": int(time.monotonic())}).encode()
    return response


#: Variants for every pack.
VARIANTS = (
    *(Variant(link.name, link.says, link=link) for link in LINKS),
    Variant("slow", "every response takes 300 ms more", lambda: _slow),
    Variant("prefix", f"everything is under {_PREFIX}", lambda: _add_prefix, prefix=_PREFIX),
    Variant("close", "HTTP/1.0, and every connection is closed", lambda: _closing),
    Variant("tls", "HTTPS with a certificate of the robot's own", tls=True),
    Variant(
        "token",
        "a bearer token is required",
        _require_field("Authorization", f"Bearer {_SECRET}", "Bearer"),
        secrets={"token_file": _SECRET},
    ),
    Variant(
        "basic",
        "a user's name and password are required",
        _require_field("Authorization", f"Basic {base64.b64encode(_BASIC.encode()).decode()}", "Basic"),
        secrets={"basic_file": _BASIC},
    ),
    Variant(
        "api-key",
        "an API key is required",
        _require_field("X-Api-Key", _SECRET, "ApiKey"),
        secrets={"api_key_file": _SECRET},
        endpoints={"api_key": "header X-Api-Key"},
    ),
    Variant("ipv6", "the robot is at [::1]", host="::1"),
    Variant("uptime", "JSON objects have an uptime that ticks", lambda: _uptime),
    Variant("ceiling", "100 requests a second, and no more", _Ceiling, endpoints={"request_rate": _CEILING * 0.8}),
)


def variants_of(contract: Contract) -> tuple[Variant, ...]:
    """Return the variants for a pack: those common to all packs and the pack's own."""
    own = self_test_of(contract).variants
    return (*VARIANTS, *(Variant(change.name, change.says, change.make) for change in own))
