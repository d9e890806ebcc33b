"""The hunt: each faulty robot is judged, and each requirement that must catch it has to say so."""

from __future__ import annotations

import queue
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

from conformance.selftest.certifying import Job, Outcome, judge
from conformance.selftest.proxy import Proxy, unchanged
from conformance.selftest.robots import REFERENCE, Robot, running, statement_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from conformance.selftest.mutants.mutant import Fault

# How long one run may take, s, by effort.
_TIMEOUTS = {"quick": 90.0, "standard": 240.0, "deep": 900.0}


@dataclass
class Catch:
    """What came of one faulty robot.

    Attributes:
        fault: which.
        caught: requirements that said fail or warn, of those that must and of others.
        missed: requirements that must have, and did not.
        effort: the effort at which all had.
        unseen: why it was not tried, or empty.
        seconds: how long it took; runs: how many runs.
        reasons: what was said of the missed ones.
    """

    fault: Fault
    caught: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()
    effort: str = ""
    unseen: str = ""
    seconds: float = 0.0
    runs: int = 0
    reasons: dict[str, str] = field(default_factory=dict)


class Bench:
    """Robots with a proxy before each, for as many runs at once.

    Args:
        kind: the good robot behind the proxies.
        size: how many.
        domain_id: ROS domain of the first; the next ones take the next.

    Raises:
        RobotError: a robot does not start.
    """

    def __init__(self, kind: str, size: int, domain_id: int) -> None:
        self.kind = kind
        self._stack = ExitStack()
        self._free: queue.Queue[tuple[Robot, Proxy]] = queue.Queue()
        self.size = size
        try:
            for number in range(size):
                robot = self._stack.enter_context(running(kind, domain_id + number))
                proxy = Proxy(robot.rest, robot.soap)
                self._stack.callback(proxy.close)
                self._free.put((robot, proxy))
        except BaseException:
            self._stack.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def take(self) -> tuple[Robot, Proxy]:
        """A robot that is free, and its proxy."""
        return self._free.get()

    def give(self, robot: Robot, proxy: Proxy) -> None:
        """Give them back, as they were."""
        proxy.change, proxy.torn, proxy.serial = unchanged, None, False
        proxy.broken = []
        self._free.put((robot, proxy))


def job_for(robot: Robot, proxy: Proxy, effort: str, seed: int, **more: object) -> Job:
    """A job that judges a robot through its proxy."""
    return Job(
        statement=statement_of(robot.kind),
        rest=proxy.rest,
        publishers=proxy.wsdl("publisher"),
        subscribers=proxy.wsdl("subscriber"),
        effort=effort,
        seed=seed,
        timeout_s=_TIMEOUTS[effort],
        **more,  # type: ignore[arg-type] # Job's further fields by name
    )


def without_fault(bench: Bench, effort: str = "quick", seed: int = 0) -> Outcome:
    """What is said of the good robot behind a proxy that changes nothing."""
    robot, proxy = bench.take()
    try:
        return judge(job_for(robot, proxy, effort, seed, domain_id=robot.domain_id))
    finally:
        bench.give(robot, proxy)


def hunt(
    bench: Bench,
    faults: Iterable[Fault],
    *,
    effort: str = "quick",
    seed: int = 0,
    already: frozenset[str] = frozenset(),
    tell: Callable[[Catch], None],
) -> list[Catch]:
    """Try every fault, several at once.

    Args:
        bench: the robots.
        faults: what to try.
        effort: of the first runs.
        seed: of everything random.
        already: requirements that say fail or warn of the good robot itself: nothing can be shown of them.
        tell: called as each is done.
    """
    lock = threading.Lock()

    def one(fault: Fault) -> Catch:
        robot, proxy = bench.take()
        try:
            catch = _try(fault, robot, proxy, effort, seed, already)
        finally:
            bench.give(robot, proxy)
        with lock:
            tell(catch)
        return catch

    with ThreadPoolExecutor(bench.size) as pool:
        return list(pool.map(one, faults))


def _try(fault: Fault, robot: Robot, proxy: Proxy, effort: str, seed: int, already: frozenset[str]) -> Catch:
    catch = Catch(fault)
    if already.intersection(fault.catches):
        catch.unseen = f"{robot.kind} itself is blamed for {min(already.intersection(fault.catches))}, as it may be"
        return catch
    if robot.kind != REFERENCE and fault.probe:
        catch.unseen = "only a ROS probe can see it, and there is no ROS"
        return catch
    if robot.kind not in {REFERENCE, "baroque"} and fault.observer:
        catch.unseen = "the robot has no list of deliveries, and there is no ROS"
        return catch
    classes = tuple(dict.fromkeys(id_.split("/")[0] for id_ in fault.catches))
    seen: dict[str, None] = {}
    # The checks that judge the requirements alone; then the whole classes; then those with more cases.
    attempts = [(effort, fault.catches), (effort, ()), ("standard", ())]
    for chosen, requirements in attempts:
        proxy.change = fault.make()
        proxy.torn = fault.torn() if fault.torn else None
        proxy.serial = fault.serial
        outcome = judge(
            job_for(
                robot,
                proxy,
                chosen,
                seed,
                classes=classes,
                requirements=requirements,
                domain_id=robot.domain_id if fault.probe else None,
                token=fault.token,
            )
        )
        seen.update(dict.fromkeys(outcome.caught()))
        _note(catch, outcome, tuple(seen), chosen)
        if proxy.broken:
            # What such a fault does is not what it says: nothing that it shows counts.
            catch.missed = fault.catches
            catch.reasons = dict.fromkeys(fault.catches, f"the fault itself is broken: {proxy.broken[0]}")
            break
        if not catch.missed:
            break
    return catch


def _note(catch: Catch, outcome: Outcome, seen: tuple[str, ...], effort: str) -> None:
    catch.runs += 1
    catch.seconds += outcome.seconds
    catch.caught, catch.effort = seen, effort
    catch.missed = tuple(id_ for id_ in catch.fault.catches if id_ not in seen)
    given_up = "the run was given up" if outcome.exit_code < 0 else "pass"
    catch.reasons = {
        id_: f"{outcome.verdicts.get(id_, 'not judged')}: {outcome.reasons.get(id_, given_up)}" for id_ in catch.missed
    }
