"""Certify each hand-written mutant and see whether each requirement that must kill it fails or warns."""

import queue
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from conformance.contract.ledger import classes_of
from conformance.contract.pack import Contract
from proof.mutation.messages import Change, unchanged
from proof.mutation.self_test import GoodDevice
from proof.mutation.table import Mutant
from proof.selftest.at_once import each_at_once
from proof.selftest.certifying import Job, Outcome, job_at, run_job
from proof.selftest.proxy import Proxy
from proof.selftest.robots import Robot, running

# Longest time of one run by effort, s.
_TIMEOUTS = {"quick": 90.0, "standard": 240.0, "deep": 900.0}


@dataclass
class MutantResult:
    """The result of one hand-written mutant.

    Attributes:
        mutant: the mutant.
        killed_by: requirements that failed or warned, including those that do not have to.
        survived: requirements that must kill the mutant and passed it.
        effort: effort of the last run.
        not_tried: why the mutant was not run, or empty.
        seconds: total duration, s.
        runs: number of runs.
        reasons: what the requirements in ``survived`` reported instead.
    """

    mutant: Mutant
    killed_by: tuple[str, ...] = ()
    survived: tuple[str, ...] = ()
    effort: str = ""
    not_tried: str = ""
    seconds: float = 0.0
    runs: int = 0
    reasons: dict[str, str] = field(default_factory=dict)


class Pool:
    """Good devices, each with a proxy in front that can turn it into a mutant; one for each parallel run.

    Args:
        contract: the pack.
        kind: the devices' name.
        size: number of devices.
    """

    def __init__(self, contract: Contract, kind: str, size: int) -> None:
        self.contract, self.kind, self.size = contract, kind, size
        self._stack = ExitStack()
        self._free: queue.Queue[tuple[Robot, Proxy]] = queue.Queue()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def add(self, robot: Robot) -> None:
        """Put a proxy in front of a device, and the two into the pool."""
        proxy = Proxy(robot.rest, robot.publishers or robot.subscribers)
        self._stack.callback(proxy.close)
        self._free.put((robot, proxy))

    def take(self) -> tuple[Robot, Proxy]:
        """Return a device that no run uses, and its proxy."""
        return self._free.get()

    def give(self, robot: Robot, proxy: Proxy) -> None:
        """Return a device and its proxy to the pool, and remove the mutant from the proxy."""
        proxy.change, proxy.incomplete_request = unchanged, None
        proxy.serial = proxy.backwards = proxy.forgetful = False
        proxy.broken = []
        self._free.put((robot, proxy))


class DescribedPool(Pool):
    """A running device of which only its description is known, behind several proxies.

    Args:
        contract: made from its description.
        base_url: URL below which its operations are.
        statement: file with what may be called.
        size: number of proxies.
    """

    def __init__(self, contract: Contract, base_url: str, statement: Path, size: int) -> None:
        super().__init__(contract, base_url, size)
        device = GoodDevice(base_url, lambda _: [], statement)
        for _ in range(size):
            self.add(Robot(contract.directory, device, base_url))


class RobotPool(Pool):
    """Good devices that are started for the pool.

    Args:
        contract: the pack.
        device: the good device to start behind each proxy.
        size: number of devices.
        domain_id: ROS domain of the first device; the others take the next ones.

    Raises:
        RobotError: a device does not start.
    """

    def __init__(self, contract: Contract, device: GoodDevice, size: int, domain_id: int = 0) -> None:
        super().__init__(contract, device.name, size)
        try:
            for number in range(size):
                self.add(self._stack.enter_context(running(contract, device, domain_id + number)))
        except BaseException:
            self._stack.close()
            raise


def become(proxy: Proxy, mutant: Mutant) -> None:
    """Set the proxy's changes so that the robot behind it becomes the mutant for one run."""
    proxy.change = mutant.make()
    proxy.incomplete_request = mutant.incomplete_request() if mutant.incomplete_request else None
    proxy.serial, proxy.backwards, proxy.forgetful = mutant.serial, mutant.backwards, mutant.forgetful


def job_for(robot: Robot, proxy: Proxy, effort: str, seed: int, token: str = "", **more: Any) -> Job:
    """Return a job that certifies a robot through its proxy, with a bearer token if it wants one."""
    more |= {"secrets": {"token_file": token}} if token else {}
    return job_at(proxy.before(robot), effort=effort, seed=seed, timeout_s=_TIMEOUTS[effort], **more)


def run_unchanged(pool: Pool, effort: str = "quick", seed: int = 0, change: Change = unchanged) -> Outcome:
    """Return the outcome of the good robot behind a proxy that changes nothing: the A/A control.

    Args:
        pool: the devices.
        effort: the effort of the run.
        seed: the seed of everything random.
        change: what the proxy does; it changes nothing.
    """
    robot, proxy = pool.take()
    try:
        proxy.change = change
        return run_job(job_for(robot, proxy, effort, seed, domain_id=robot.domain_id))
    finally:
        pool.give(robot, proxy)


def run_mutants(
    pool: Pool,
    mutants: Iterable[Mutant],
    *,
    effort: str = "quick",
    seed: int = 0,
    already: frozenset[str] = frozenset(),
    tell: Callable[[MutantResult], None],
) -> list[MutantResult]:
    """Run every mutant, several in parallel, and return the results.

    Args:
        pool: the devices.
        mutants: the mutants to run.
        effort: effort of each mutant's first run.
        seed: seed of everything random.
        already: requirements that fail or warn on the good robot itself, so that no mutant can show anything of them.
        tell: called with each result when it is ready.
    """

    def one(mutant: Mutant) -> MutantResult:
        robot, proxy = pool.take()
        try:
            return _try(pool.contract, mutant, robot, proxy, effort, seed, already)
        finally:
            pool.give(robot, proxy)

    return each_at_once(one, mutants, pool.size, tell)


def _obstacle(mutant: Mutant, robot: Robot, already: frozenset[str]) -> str:
    """Return why a mutant of this robot cannot be run, or an empty text."""
    if shared := already.intersection(mutant.catches):
        return f"{robot.kind} itself does not pass {min(shared)}"
    if mutant.probe and not robot.device.on_ros:
        return "only a ROS probe can see it, and there is no ROS"
    if mutant.observer and not (robot.device.on_ros or robot.device.shows_effects):
        return f"{robot.kind} does not show what reached it, and there is no ROS"
    return ""


def _try(
    contract: Contract, mutant: Mutant, robot: Robot, proxy: Proxy, effort: str, seed: int, already: frozenset[str]
) -> MutantResult:
    result = MutantResult(mutant, not_tried=_obstacle(mutant, robot, already))
    if result.not_tried:
        return result
    classes = classes_of(contract.ledger, mutant.catches)
    domain_id = robot.domain_id if mutant.probe else None
    seen: dict[str, None] = {}
    # First the checks of the requirements alone, then whole classes, then more cases.
    for chosen, requirements in ((effort, mutant.catches), (effort, ()), ("standard", ())):
        become(proxy, mutant)
        more: dict[str, Any] = {"classes": classes, "requirements": requirements, "domain_id": domain_id}
        outcome = run_job(job_for(robot, proxy, chosen, seed, token=mutant.token, **more))
        seen.update(dict.fromkeys(outcome.not_passed()))
        _note(result, outcome, tuple(seen), chosen)
        if proxy.broken:
            # A broken mutant does something else than it says, so nothing that it shows counts.
            result.survived = mutant.catches
            result.reasons = dict.fromkeys(mutant.catches, f"the mutant itself is broken: {proxy.broken[0]}")
            break
        if not result.survived:
            break
    return result


def _note(result: MutantResult, outcome: Outcome, seen: tuple[str, ...], effort: str) -> None:
    result.runs += 1
    result.seconds += outcome.seconds
    result.killed_by, result.effort = seen, effort
    result.survived = tuple(id_ for id_ in result.mutant.catches if id_ not in seen)
    given_up = "the run was given up" if outcome.exit_code < 0 else "pass"
    result.reasons = {
        id_: f"{outcome.verdicts.get(id_, 'not judged')}: {outcome.reasons.get(id_, given_up)}"
        for id_ in result.survived
    }
