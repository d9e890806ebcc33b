"""Judge generated mutants by the verdict of a certification of the classes most likely to kill them."""

import re
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from conformance.contract.classes import Level
from conformance.contract.ledger import classes_of
from conformance.contract.pack import Contract
from proof.mutation.messages import unchanged
from proof.selftest.at_once import each_at_once
from proof.selftest.certifying import Outcome, run_job, statement_of
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.mutant_run import Pool, job_for
from proof.selftest.proxy import Proxy
from proof.selftest.robots import Robot

KILLED: Final = "killed"
SURVIVED: Final = "survived"
NOT_REACHED: Final = "not reached"
# The run took too long or broke off, so nothing is known.
GIVEN_UP: Final = "given up"
# The mutant did not do what its text says: an error of the self-test.
BROKEN: Final = "broken"
# Classes to claim, and requirements to judge alone (empty: all).
Attempt = tuple[tuple[str, ...], tuple[str, ...]]
_WORD: Final = re.compile(r"[A-Z]?[a-z]+")


@dataclass
class GeneratedResult:
    """The result of one generated mutant.

    Attributes:
        mutant: the mutant.
        outcome: killed, survived, not reached (the mutant altered nothing in any run), given up (timeout) or broken.
        by: requirements that failed (MUST) or warned (SHOULD) on the mutant and not on the good device.
        fails: whether one of them failed, so that the device is not conformant.
        effort: the effort at which the mutant was killed, else the last one tried.
        altered: number of messages that the mutant altered.
        runs: number of runs.
        seconds: their total duration, s.
        reason: the reason of the first requirement, or the error of a broken mutant.
    """

    mutant: GeneratedMutant
    outcome: str = SURVIVED
    by: tuple[str, ...] = ()
    fails: bool = False
    effort: str = ""
    altered: int = 0
    runs: int = 0
    seconds: float = 0.0
    reason: str = ""


def judge(
    pool: Pool,
    mutants: Iterable[GeneratedMutant],
    *,
    efforts: tuple[str, ...] = ("quick", "standard"),
    seed: int = 0,
    unreached: frozenset[str] = frozenset(),
    tell: Callable[[GeneratedResult], None],
) -> list[GeneratedResult]:
    """Judge generated mutants, several in parallel, and return the results.

    Args:
        pool: good devices, each with a proxy in front.
        mutants: the mutants to judge.
        efforts: efforts to try in this order until the mutant is killed.
        seed: seed of everything random.
        unreached: names of mutants that are known to alter nothing in any run.
        tell: called with each result when it is ready.
    """
    control = _Control(pool.contract, seed)

    def one(mutant: GeneratedMutant) -> GeneratedResult:
        if mutant.name in unreached:
            return GeneratedResult(mutant, NOT_REACHED, effort=efforts[-1])
        robot, proxy = pool.take()
        try:
            return _judge(pool.contract, mutant, robot, proxy, efforts, seed, control)
        finally:
            pool.give(robot, proxy)

    return each_at_once(one, mutants, pool.size, tell)


class _Control:
    """The A/A control: the requirements that the unchanged device does not pass, which therefore kill no mutant."""

    def __init__(self, contract: Contract, seed: int) -> None:
        self._contract, self._seed = contract, seed
        self._known: dict[str, dict[str, bool]] = {}
        self._lock = threading.Lock()

    def known_failures(self, effort: str) -> frozenset[str]:
        """Return the requirements that the unchanged device has failed or warned so far at an effort."""
        return frozenset(id_ for id_, refuted in self._known.get(effort, {}).items() if refuted)

    def without(
        self, ids: tuple[str, ...], robot: Robot, proxy: Proxy, effort: str, *, at_once: bool = False
    ) -> tuple[str, ...]:
        """Return those of the given requirements that the unchanged device passes; each is tried on it once.

        With ``at_once``, all are tried in one run.
        """
        with self._lock:
            known = self._known.setdefault(effort, {})
            if at_once and not known:
                # A requirement judged alone sees only part of a run; checkers judge the requests of every check.
                proxy.change = unchanged
                outcome = run_job(job_for(robot, proxy, effort, self._seed))
                if outcome.exit_code < 0:
                    return ()
                known |= {id_: id_ in outcome.not_passed() for id_ in outcome.verdicts}
            if new := tuple(id_ for id_ in ids if id_ not in known):
                proxy.change = unchanged
                classes = classes_of(self._contract.ledger, new)
                outcome = run_job(job_for(robot, proxy, effort, self._seed, classes=classes, requirements=new))
                if outcome.exit_code < 0:
                    # The good device's verdict is unknown, so the mutant's shows nothing.
                    return ()
                known |= {id_: id_ in outcome.not_passed() for id_ in new}
        return tuple(id_ for id_ in ids if not known[id_])


def _judge(
    contract: Contract,
    mutant: GeneratedMutant,
    robot: Robot,
    proxy: Proxy,
    efforts: tuple[str, ...],
    seed: int,
    control: _Control,
) -> GeneratedResult:
    result = GeneratedResult(mutant)
    tally = Tally()
    # Any failure ends a run on a device that claims no contract: further failures are not needed.
    claims_none = not contract.is_claimed
    musts = frozenset(id_ for id_, item in contract.ledger.items() if claims_none or item.level is Level.MUST)
    given_up = False
    claimed = statement_of(job_for(robot, proxy, efforts[0], seed), contract).claims_of(contract)
    attempts = tuple(_attempts(contract, mutant, claimed))
    # A fault that quick misses is seldom found by other single requirements: judge everything at the next effort.
    waiting = [(efforts[0], attempt) for attempt in attempts] + [(effort, attempts[-1]) for effort in efforts[1:]]
    while waiting:
        effort, (classes, requirements) = waiting[0]
        known = control.known_failures(effort)
        proxy.change = mutant.make(tally)
        more: dict[str, Any] = {"classes": classes, "requirements": requirements, "enough": musts - known}
        outcome = run_job(job_for(robot, proxy, effort, seed, **more))
        result.runs += 1
        result.seconds += outcome.seconds
        result.effort, result.altered = effort, tally.altered
        given_up = given_up or outcome.exit_code < 0
        if proxy.broken:
            result.outcome, result.reason = BROKEN, proxy.broken[0]
            return result
        if shown := control.without(outcome.not_passed(), robot, proxy, effort, at_once=claims_none):
            _note(result, outcome, shown)
            return result
        # The good device also fails the requirement that ended the run: judge once more, to the end.
        ended_by = frozenset(outcome.not_passed()) if claims_none else outcome.fails
        if outcome.exit_code < 0 or not (ended_by & musts) - known:
            waiting.pop(0)
    result.outcome = GIVEN_UP if given_up else SURVIVED if tally.altered else NOT_REACHED
    return result


def _note(result: GeneratedResult, outcome: Outcome, by: tuple[str, ...]) -> None:
    result.outcome, result.by = KILLED, by
    result.fails = not outcome.fails.isdisjoint(by)
    result.reason = outcome.reasons.get(by[0], "")


def _attempts(contract: Contract, mutant: GeneratedMutant, claimed: tuple[str, ...]) -> Iterator[Attempt]:
    """Yield classes and requirements to judge a mutant by: first those for its operation, then whole classes.

    The classes of a device that claims no contract are judged all at once: any may notice its mutants.
    """
    if not contract.is_claimed:
        yield claimed, ()
        return
    classes = tuple(class_ for class_ in mutant.classes if class_ in claimed)
    if not classes or classes[0] != mutant.classes[0]:
        # The class that should notice is not judged, so any other may.
        classes = (*classes, *(class_ for class_ in claimed if class_ not in classes))
    words = {word.lower() for word in _WORD.findall(mutant.exchange.name)}
    first = tuple(id_ for id_, item in contract.ledger.items() if item.class_ == classes[0])
    near = tuple(id_ for id_ in first if id_.split("/")[1].split("-")[0] in words)
    types = tuple(id_ for id_ in near if id_.endswith("-type"))
    for requirements in dict.fromkeys((types, near)):
        if requirements and len(requirements) < len(first):
            yield classes[:1], requirements
    # Checkers of a whole run are in classes of their own, so in the end all classes are judged together.
    yield from dict.fromkeys((tuple(classes[:number]), ()) for number in (1, len(classes)))
