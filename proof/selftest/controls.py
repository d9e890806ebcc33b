"""A/A controls: good devices and their variants, over many seeds. Each failure is a false positive."""

import base64
import contextlib
import json
import shutil
import ssl
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any

from conformance.contract.pack import Contract
from conformance.verdict.verdicts import NOT_SEEN
from proof.mutation.changes import JSON, parsed, problem
from proof.mutation.messages import Change, Forward, Request, Response, unchanged
from proof.mutation.self_test import GoodDevice, NotInstalledError, self_test_of
from proof.selftest.at_once import each_at_once
from proof.selftest.certifying import Outcome, job_at, run_job
from proof.selftest.link import LINKS, Link, link_to
from proof.selftest.proxy import Proxy
from proof.selftest.robots import Robot, RobotError, check_available, running
from proof.selftest.servers.fronts import FRONTS, Front, behind

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


# Deadline of a control, s: a device may take 300 ms for every response.
_TIMEOUT_S = 900.0


@dataclass(frozen=True)
class Case:
    """One good device to judge: the variant (link, proxy, TLS) or web server in front of it, and the run's seed."""

    device: GoodDevice
    variant: Variant | Front | None = None
    seed: int = 0


@dataclass(frozen=True)
class ControlResult:
    """The result of judging one good device.

    Attributes:
        robot: the device's name.
        variant: name of the variant or web server in front of it, or empty.
        seed: seed of the run.
        outcome: outcome of the run, or None when it did not take place.
        not_tried: why the run did not take place, or empty.
        breaks: requirements that the web server in front breaks by itself.
    """

    robot: str
    variant: str
    seed: int
    outcome: Outcome | None
    not_tried: str = ""
    breaks: frozenset[str] = frozenset()

    @property
    def false_positives(self) -> dict[str, str]:
        """Return the MUST requirements that the good device failed, with the reasons."""
        if self.outcome is None:
            return {}
        return {id_: self.outcome.reasons[id_] for id_ in self.outcome.fails - self.breaks}

    @property
    def unjudged(self) -> dict[str, str]:
        """Return the claimed requirements that got no verdict, with the reasons."""
        if self.outcome is None:
            return {}
        reasons = self.outcome.reasons
        unjudged = {id_ for id_, value in self.outcome.verdicts.items() if value in {"skip", "error"}}
        return {id_: reasons[id_] for id_ in sorted(unjudged) if reasons[id_] != NOT_SEEN}

    @property
    def conformant(self) -> bool:
        """Return whether the device was found conformant, its front's faults aside, or the run did not take place."""
        if self.outcome is None:
            return True
        blamed = self.outcome.fails
        return blamed == self.breaks if blamed & self.breaks else self.outcome.exit_code == 0 and not blamed


@dataclass
class Controls:
    """The controls of one self-test.

    Attributes:
        cases: the devices to judge, with their variants.
        missing: for each device of the pack that cannot be a control here, the reason.
    """

    cases: list[Case] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)


def controls_of(contract: Contract, seeds: int, *, short: bool, variants: bool) -> Controls:
    """Return the controls for a pack.

    Args:
        contract: the pack.
        seeds: number of seeds for each device.
        short: whether to judge one device on ROS only, to save time.
        variants: whether to judge devices also in variants and behind web servers.
    """
    needs, found = self_test_of(contract), Controls()
    there: list[GoodDevice] = []
    for device in needs.devices:
        try:
            check_available(contract, device)
        except RobotError as error:
            found.missing.append(str(error))
        else:
            there.append(device)
    if variants and there:
        # The slow one first, so that the others do not wait for it at the end.
        found.cases += [Case(needs.device_in(variant.name), variant) for variant in variants_of(contract)]
        found.cases += [Case(needs.device_in(front.name), front) for front in FRONTS]
        found.cases += [Case(device) for device in there if device.once]
    # Devices on ROS take longest, and come last.
    seeded = sorted((device for device in there if not device.once), key=lambda device: device.on_ros)
    on_ros = [device for device in seeded if device.on_ros]
    kept = [device for device in seeded if not (short and device in on_ros[1:])]
    found.cases = [case for case in found.cases if case.device in there]
    found.cases += [Case(device, None, seed) for seed in range(seeds) for device in kept]
    return found


def run_controls(
    contract: Contract,
    cases: Iterable[Case],
    *,
    effort: str = "quick",
    parallel: int = 1,
    domain_id: int = 0,
    tell: Callable[[ControlResult], None],
    requirements: tuple[str, ...] = (),
) -> list[ControlResult]:
    """Judge good devices, each in a process of its own; ``tell`` is called with each result when it is ready.

    Args:
        contract: the pack.
        cases: the devices to judge.
        effort: quick, standard or deep.
        parallel: number of devices judged in parallel.
        domain_id: first ROS domain to use.
        tell: called with each result, never twice at a time.
        requirements: ids of the requirements to judge; empty means all.
    """
    lock = threading.Lock()
    domains = list(range(domain_id, domain_id + parallel))

    def one(case: Case) -> ControlResult:
        with lock:
            domain = domains.pop()
        try:
            name = case.variant.name if case.variant else ""
            outcome, not_tried = _judge(contract, case, effort, domain, requirements)
            breaks = case.variant.breaks if isinstance(case.variant, Front) else frozenset()
            return ControlResult(case.device.name, name, case.seed, outcome, not_tried, breaks)
        finally:
            with lock:
                domains.append(domain)

    return each_at_once(one, cases, parallel, tell)


def _judge(
    contract: Contract, case: Case, effort: str, domain: int, requirements: tuple[str, ...]
) -> tuple[Outcome | None, str]:
    """Judge one device; where a program that the variant needs is not installed, return None and the program's name."""
    more = {"requirements": requirements, "effort": effort, "seed": case.seed, "timeout_s": _TIMEOUT_S}
    try:
        with contextlib.ExitStack() as stack:
            robot = stack.enter_context(running(contract, case.device, domain, case.seed))
            if isinstance(case.variant, Front):
                robot = stack.enter_context(behind(case.variant, robot))
            if isinstance(case.variant, Variant):
                robot, varied = _vary(stack, case.variant, robot, case.seed)
                more |= varied
            return run_job(job_at(robot, domain_id=robot.domain_id, **more)), ""
    except (NotInstalledError, CertificateError) as error:
        return None, str(error)


def _vary(stack: contextlib.ExitStack, variant: Variant, robot: Robot, seed: int) -> tuple[Robot, dict[str, object]]:
    """Put a variant (proxy, TLS, link) in front of a device; return its new addresses and the job's additional options.

    Raises:
        NotInstalledError, CertificateError: a program that the variant needs is missing.
    """
    endpoints, tls = dict(variant.endpoints), None
    if variant.tls:
        tls, ca_file = certificate(Path(stack.enter_context(tempfile.TemporaryDirectory())))
        endpoints["ca_file"] = str(ca_file)
    soap = robot.publishers or robot.subscribers
    try:
        proxy = Proxy(robot.rest, soap, host=variant.host, tls=tls, prefix=variant.prefix)
    except OSError as error:
        raise NotInstalledError(f"{variant.host} cannot be listened on: {error}") from error
    stack.callback(proxy.close)
    if variant.link is not None:
        addresses = stack.enter_context(link_to(variant.link, seed, *proxy.listens.values()))
        proxy.seen_at(
            **{side: f"http://{host}:{port}" for side, (host, port) in zip(proxy.listens, addresses, strict=True)}
        )
    proxy.change = variant.make()
    return proxy.before(robot), {"secrets": variant.secrets, "endpoints": endpoints}
