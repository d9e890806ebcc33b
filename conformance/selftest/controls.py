"""False alarms: good robots, over many seeds and in many circumstances, none of which may be blamed."""

import contextlib
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from conformance.selftest.at_once import each_at_once
from conformance.selftest.certifying import Job, Outcome, run_job
from conformance.selftest.link import linked
from conformance.selftest.proxy import Proxy
from conformance.selftest.robots import Robot, running, statement_of
from conformance.selftest.servers.fronts import Front, behind
from conformance.selftest.servers.programs import NotInstalledError
from conformance.selftest.variants import CertificateError, Variant, certificate
from conformance.verdict.verdicts import NOT_SEEN

# A robot that takes 300 ms for everything needs its time.
_TIMEOUT_S = 900.0


@dataclass(frozen=True)
class ControlResult:
    """What was said of a good robot.

    Attributes:
        robot: which; variant: in which circumstances, or empty.
        seed: of the run.
        outcome: what came of it, or None when it was not tried.
        not_tried: why it was not tried, or empty.
    """

    robot: str
    variant: str
    seed: int
    outcome: Outcome | None
    not_tried: str = ""

    @property
    def blamed(self) -> dict[str, str]:
        """MUST requirements that a good robot was said to fail, with what was said."""
        if self.outcome is None:
            return {}
        return {id_: self.outcome.reasons[id_] for id_, value in self.outcome.verdicts.items() if value == "fail"}

    @property
    def unjudged(self) -> dict[str, str]:
        """Requirements that could not be judged although they are claimed, with the reason."""
        if self.outcome is None:
            return {}
        reasons = self.outcome.reasons
        unjudged = {id_ for id_, value in self.outcome.verdicts.items() if value in {"skip", "error"}}
        return {id_: reasons[id_] for id_ in sorted(unjudged) if reasons[id_] != NOT_SEEN}

    @property
    def conformant(self) -> bool:
        """Whether the robot was found conformant (or was not tried)."""
        return self.outcome is None or (self.outcome.exit_code == 0 and not self.blamed)


@dataclass(frozen=True)
class Case:
    """One robot to try: in which circumstances or behind which server, with which seed."""

    robot: str
    variant: Variant | Front | None
    seed: int


def run_controls(
    cases: list[Case],
    *,
    effort: str,
    parallel: int,
    domain_id: int,
    tell: Callable[[ControlResult], None],
    requirements: tuple[str, ...] = (),
) -> list[ControlResult]:
    """Judge good robots, each case on a robot of its own, by all requirements or these; tell each when it is done."""
    lock = threading.Lock()
    domains = list(range(domain_id, domain_id + parallel))

    def one(case: Case) -> ControlResult:
        with lock:
            domain = domains.pop()
        try:
            return _try(case, effort, domain, requirements)
        finally:
            with lock:
                domains.append(domain)

    return each_at_once(one, cases, parallel, tell)


def _try(case: Case, effort: str, domain: int, requirements: tuple[str, ...]) -> ControlResult:
    """Judge one robot; what its circumstances need and this machine lacks is said."""
    name = case.variant.name if case.variant else ""
    try:
        with contextlib.ExitStack() as stack:
            robot = stack.enter_context(running(case.robot, domain, case.seed))
            if isinstance(case.variant, Front):
                robot = stack.enter_context(behind(case.variant, robot))
            job = Job(
                statement_of(case.robot),
                robot.rest,
                robot.soap,
                robot.soap.replace("publisher", "subscriber"),
                requirements=requirements,
                effort=effort,
                seed=case.seed,
                timeout_s=_TIMEOUT_S,
                domain_id=robot.domain_id,
            )
            if isinstance(case.variant, Variant):
                return _vary(case, case.variant, robot, job, Path(stack.enter_context(tempfile.TemporaryDirectory())))
            return ControlResult(case.robot, name, case.seed, run_job(job))
    except NotInstalledError as error:
        return ControlResult(case.robot, name, case.seed, None, str(error))


def _vary(case: Case, variant: Variant, robot: Robot, job: Job, folder: Path) -> ControlResult:
    endpoints = dict(variant.endpoints)
    tls = None
    if variant.tls:
        try:
            tls, ca_file = certificate(folder)
        except CertificateError as error:
            return ControlResult(case.robot, variant.name, case.seed, None, str(error))
        endpoints["ca_file"] = str(ca_file)
    try:
        proxy = Proxy(robot.rest, robot.soap, host=variant.host, tls=tls, prefix=variant.prefix)
    except OSError as error:
        return ControlResult(
            case.robot, variant.name, case.seed, None, f"{variant.host} cannot be listened on: {error}"
        )
    with contextlib.ExitStack() as stack:
        stack.callback(proxy.close)
        if variant.link is not None:
            addresses = stack.enter_context(linked(variant.link, case.seed, *proxy.listens.values()))
            proxy.seen_at(
                **{side: f"http://{host}:{port}" for side, (host, port) in zip(proxy.listens, addresses, strict=True)}
            )
        proxy.change = variant.make()
        varied = replace(
            job,
            rest=proxy.rest,
            publishers=proxy.wsdl("publisher"),
            subscribers=proxy.wsdl("subscriber"),
            token=variant.token,
            endpoints=endpoints,
        )
        return ControlResult(case.robot, variant.name, case.seed, run_job(varied))
