"""Mutants by rule are judged by the product's verdict, with the classes that can see them, the likeliest first."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from conformance.contract.classes import Level
from conformance.contract.pack import Contract
from conformance.mutation.messages import unchanged
from conformance.packs.table1.statement import load_robot_statement
from conformance.selftest.at_once import each_at_once
from conformance.selftest.certifying import Outcome, run_job
from conformance.selftest.generated.mutant import GeneratedMutant, Tally
from conformance.selftest.mutant_run import RobotPool, job_for
from conformance.selftest.proxy import Proxy
from conformance.selftest.robots import Robot, statement_of

CAUGHT: Final = "caught"
SURVIVED: Final = "survived"
NOT_REACHED: Final = "not reached"
# A run took too long or broke off, so that nothing is known.
GIVEN_UP: Final = "given up"
# What a mutant did was not what it says: its own mistake.
BROKEN: Final = "broken"
# Classes that are claimed, and requirements that are judged alone (all, where there are none).
Attempt = tuple[tuple[str, ...], tuple[str, ...]]
_WORD: Final = re.compile(r"[A-Z]?[a-z]+")


@dataclass
class GeneratedResult:
    """What came of one mutant by rule.

    Attributes:
        mutant: which.
        outcome: caught, survived, not reached (nothing was altered in any run), given up, broken.
        by: requirements that said fail (MUST) or warn (SHOULD) and do not of the good robot.
        fails: whether one of them said fail, so that the robot is not conformant.
        effort: the effort at which it was caught, else the last one tried.
        altered: how often it altered something.
        runs: how many runs; seconds: how long they took.
        reason: the first requirement's, or what was broken.
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
    pool: RobotPool,
    mutants: Iterable[GeneratedMutant],
    *,
    efforts: tuple[str, ...] = ("quick", "standard"),
    seed: int = 0,
    tell: Callable[[GeneratedResult], None],
) -> list[GeneratedResult]:
    """Judge mutants, several at once.

    Args:
        pool: good robots with a proxy before each.
        mutants: which.
        efforts: those to try, until it is caught.
        seed: of everything random.
        tell: called as each is done.
    """
    claimed = load_robot_statement(statement_of(pool.kind)).claimed(Contract.load())
    blamed = _Blamed(seed)

    def one(mutant: GeneratedMutant) -> GeneratedResult:
        robot, proxy = pool.take()
        try:
            return _judge(mutant, robot, proxy, efforts, seed, claimed, blamed)
        finally:
            pool.give(robot, proxy)

    return each_at_once(one, mutants, pool.size, tell)


class _Blamed:
    """What is said of the good robot itself: nothing can be shown by that."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._known: dict[str, dict[str, bool]] = {}
        self._lock = threading.Lock()

    def known(self, effort: str) -> frozenset[str]:
        """Requirements that are known to blame the good robot."""
        return frozenset(id_ for id_, blames in self._known.get(effort, {}).items() if blames)

    def without(self, caught: tuple[str, ...], robot: Robot, proxy: Proxy, effort: str) -> tuple[str, ...]:
        """Those of some requirements that blame a mutant and do not blame the good robot, which is tried for each."""
        with self._lock:
            known = self._known.setdefault(effort, {})
            if new := tuple(id_ for id_ in caught if id_ not in known):
                proxy.change = unchanged
                classes = tuple(dict.fromkeys(id_.split("/")[0] for id_ in new))
                outcome = run_job(job_for(robot, proxy, effort, self._seed, classes=classes, requirements=new))
                if outcome.exit_code < 0:
                    # Nothing is known of the good robot, so nothing is shown of the mutant.
                    return ()
                known |= {id_: id_ in outcome.caught() for id_ in new}
        return tuple(id_ for id_ in caught if not known[id_])


def _judge(
    mutant: GeneratedMutant,
    robot: Robot,
    proxy: Proxy,
    efforts: tuple[str, ...],
    seed: int,
    claimed: tuple[str, ...],
    blamed: _Blamed,
) -> GeneratedResult:
    result = GeneratedResult(mutant)
    tally = Tally()
    ledger = Contract.load().ledger
    musts = frozenset(id_ for id_, requirement in ledger.items() if requirement.level is Level.MUST)
    given_up = False
    waiting = [(effort, attempt) for effort in efforts for attempt in _attempts(mutant, claimed)]
    while waiting:
        effort, (classes, requirements) = waiting[0]
        known = blamed.known(effort)
        proxy.change = mutant.make(tally)
        more = {"classes": classes, "requirements": requirements, "enough": musts - known}
        outcome = run_job(job_for(robot, proxy, effort, seed, **more))
        result.runs += 1
        result.seconds += outcome.seconds
        result.effort, result.altered = effort, tally.altered
        given_up = given_up or outcome.exit_code < 0
        if proxy.broken:
            result.outcome, result.reason = BROKEN, proxy.broken[0]
            return result
        if shown := blamed.without(outcome.caught(), robot, proxy, effort):
            _note(result, outcome, shown)
            return result
        # What ended the run blames the good robot as well, which is known by now: once more, to its end.
        if not (outcome.fails & musts) - known:
            waiting.pop(0)
    result.outcome = GIVEN_UP if given_up else SURVIVED if tally.altered else NOT_REACHED
    return result


def _note(result: GeneratedResult, outcome: Outcome, by: tuple[str, ...]) -> None:
    result.outcome, result.by = CAUGHT, by
    result.fails = not outcome.fails.isdisjoint(by)
    result.reason = outcome.reasons.get(by[0], "")


def _attempts(mutant: GeneratedMutant, claimed: tuple[str, ...]) -> Iterator[Attempt]:
    """Classes and requirements to judge, one after the other: those about the operation, then whole classes."""
    classes = tuple(class_ for class_ in mutant.classes if class_ in claimed)
    words = {word.lower() for word in _WORD.findall(mutant.exchange.name)}
    ids = Contract.load().ledger
    first = tuple(id_ for id_ in ids if id_.split("/")[0] == classes[0]) if classes else ()
    near = tuple(id_ for id_ in first if id_.split("/")[1].split("-")[0] in words)
    types = tuple(id_ for id_ in near if id_.endswith("-type"))
    for requirements in dict.fromkeys((types, near)):
        if requirements and len(requirements) < len(first):
            yield classes[:1], requirements
    # What is watched over a whole run is in classes of its own, so that in the end all are judged at once.
    yield from dict.fromkeys((tuple(classes[:number]), ()) for number in (1, len(classes)) if classes)
