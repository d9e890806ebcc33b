"""Circumstances in which a good robot stays a good one: what stands between it and its clients in the field."""

import contextlib
import json
import shutil
import ssl
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any

from conformance.mutation.changes import JSON, parsed, problem, soap
from conformance.mutation.messages import Change, Forward, Request, Response, unchanged
from conformance.mutation.wire import IncompleteMessageError
from conformance.selftest.link import LINKS, Link

_PREFIX = "/r2d2/api"
_TOKEN = "open-sesame"  # noqa: S105 - of a robot that lives for seconds, on loopback
_DELAY_S = 0.3
_CEILING = 100.0
_MESSAGE_S, _FORGOTTEN_S = 0.05, 2.0


@dataclass(frozen=True)
class Variant:
    """One circumstance.

    Attributes:
        name: its name; says: what it is, in a few words.
        robot: the good robot in it.
        make: makes the change.
        host: where the proxy listens; prefix: its path; tls: whether it speaks TLS.
        token: bearer token to send.
        endpoints: what the statement says of it.
        link: what the clients are away by, or None where they are beside the robot.
    """

    name: str
    says: str
    make: Callable[[], Change] = lambda: unchanged
    host: str = "127.0.0.1"
    prefix: str = ""
    tls: bool = False
    token: str = ""
    endpoints: dict[str, Any] = field(default_factory=dict)
    robot: str = "baroque"
    link: Link | None = None


class CertificateError(Exception):
    """No certificate can be made here."""


def certificate(folder: Path) -> tuple[ssl.SSLContext, Path]:
    """A context that serves with a certificate of its own making, and the file by which to trust it.

    Raises:
        CertificateError: there is no openssl, or it fails.
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


def _prefixed(request: Request, forward: Forward) -> Response:
    """Descriptions say under which path everything is."""
    response = forward(request)
    if request.side == "rest" and request.path.endswith("/openapi.json"):
        value = parsed(response.body)
        if isinstance(value, dict):
            response.body = json.dumps({**value, "servers": [{"url": _PREFIX}]}).encode()
    return response


def _closing(request: Request, forward: Forward) -> Response:
    response = forward(request)
    response.version = "HTTP/1.0"
    response.put("Connection", "close")
    return response


def _guarded(request: Request, forward: Forward) -> Response:
    """A token is wanted for everything that is HTTP; without it, 401 as RFC 9110 has it."""
    if request.raw is None and request.field("Authorization") != f"Bearer {_TOKEN}":
        return problem(401, "a bearer token is wanted", ("WWW-Authenticate", 'Bearer realm="robot"'))(request)
    return forward(request)


class _Ceiling:
    """More requests than the ceiling allows within a second are answered 429."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._lock = threading.Lock()

    def __call__(self, request: Request, forward: Forward) -> Response:
        now = time.monotonic()
        with self._lock:
            self._times = [*(one for one in self._times if now - one < 1.0), now]
            # A tenth more than the ceiling: clients' clocks and scheduling are no fault of theirs.
            full = len(self._times) > _CEILING * 1.1
        if full:
            return problem(429, "too many requests", ("Retry-After", "1"))(request)
        return forward(request)


class _Behind:
    """SOAP speaks of pose and velocity as they were some messages ago, as a process of its own may."""

    def __init__(self) -> None:
        self._states = soap("GetPose", "GetVelocity")
        self._known: dict[bytes, deque[Response]] = {}
        self._asked = 0.0

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not self._states(request) or request.media_type != "text/xml":
            return forward(request)
        self._asked = time.monotonic()
        if request.body not in self._known:
            self._known[request.body] = deque([forward(request)], maxlen=2)
            threading.Thread(target=self._follow, args=(request, forward), daemon=True).start()
        return deepcopy(self._known[request.body][0])

    def _follow(self, request: Request, forward: Forward) -> None:
        """Read the state again and again, as long as somebody asks for it."""
        with contextlib.suppress(OSError, IncompleteMessageError):
            while time.monotonic() - self._asked < _FORGOTTEN_S:
                time.sleep(_MESSAGE_S)
                self._known[request.body].append(forward(request))
        del self._known[request.body]


def _uptime(request: Request, forward: Forward) -> Response:
    """Every JSON object tells for how many seconds the robot has been up."""
    response = forward(request)
    if request.side != "rest" or response.status != HTTPStatus.OK or response.media_type != JSON:
        return response
    value = parsed(response.body)
    if request.method == "HEAD":
        response.drop("Content-Length")
    elif isinstance(value, dict) and "openapi" not in value:
        response.body = json.dumps({**value, "uptime": int(time.monotonic())}).encode()
    return response


VARIANTS = (
    *(Variant(link.name, link.says, link=link) for link in LINKS),
    # Whose velocities hold long enough to be read at such a pace.
    Variant("slow", "every answer takes 300 ms more", lambda: _slow, robot="plain"),
    Variant("prefix", f"everything is under {_PREFIX}", lambda: _prefixed, prefix=_PREFIX),
    Variant("close", "HTTP/1.0, and every connection is closed", lambda: _closing),
    Variant("tls", "HTTPS with a certificate of the robot's own", tls=True),
    Variant("token", "a bearer token is wanted", lambda: _guarded, token=_TOKEN),
    Variant("ipv6", "the robot is at [::1]", host="::1"),
    Variant("behind", "SOAP is a message or two behind REST", _Behind),
    Variant("uptime", "JSON objects have an uptime that ticks", lambda: _uptime),
    Variant("ceiling", "100 requests a second, and no more", _Ceiling, endpoints={"request_rate": _CEILING * 0.8}),
)
