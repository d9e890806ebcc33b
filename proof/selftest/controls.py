"""A/A controls: good devices, over many seeds and in many circumstances. Each failure is a false positive."""

import contextlib
import tempfile
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from conformance.contract.pack import Contract
from conformance.verdict.verdicts import NOT_SEEN
from proof.mutation.self_test import GoodDevice, NotInstalledError, self_test_of
from proof.selftest.at_once import each_at_once
from proof.selftest.certifying import Outcome, job_at, run_job
from proof.selftest.link import link_to
from proof.selftest.proxy import Proxy
from proof.selftest.robots import Robot, RobotError, check_available, running
from proof.selftest.servers.fronts import FRONTS, Front, behind
from proof.selftest.variants import CertificateError, Variant, certificate, variants_of

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
    # Those on ROS take longest, and come last.
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
        requirements: ids of the requirements to judge; empty: all.
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
