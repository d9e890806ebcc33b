"""Whether `roaas diff` is right on pairs of a good robot and a faulty one (a mutant), in both directions.

``python benchmarks/diff_pairs.py --pairs 100`` takes mutants from all classes in turn. It judges each of them, and the
good robot behind the same proxy, on the mutant's classes, and runs `roaas diff` on the two results. It is known what
broke: the requirements that the mutant is made to break, and any other whose verdict differs between the two result
files. `roaas diff` must name exactly those as new failures (or new warnings), and exit with 1 where one is a
MUST; in reverse it must name exactly those as fixed, and exit with 0. The exit code is 1 if a pair is wrong.
"""

import argparse
import fnmatch
import itertools
import json
import random
import re
import sys
import tempfile
import threading
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from click.testing import CliRunner

from conformance.contract.pack import Contract
from conformance.mutation.messages import unchanged
from conformance.mutation.mutant import Mutant
from conformance.packs.table1.mutants import MUTANTS
from conformance.packs.table1.selftest import BAROQUE
from conformance.selftest.certifying import run_job
from conformance.selftest.mutant_run import RobotPool, become, job_for
from conformance.selftest.proxy import Proxy
from conformance.selftest.robots import Robot
from reports.cli.difference import diff

_RUN_S = 400.0
_HEADING = re.compile(r"^(\w[\w ]+) \(\d+\)\. ")
_LINE = re.compile(r"^  (\S+/\S+) \(")
_FAILURES, _WARNINGS, _FIXED = "New failures", "New warnings", "Fixed"
_BROKEN = ("fail", "warn")


@dataclass(frozen=True)
class Answer:
    """What `roaas diff` printed: its exit code, and the requirements under each heading."""

    exit_code: int
    named: dict[str, set[str]]


def main() -> int:
    """Judge the pairs; return 0 when `roaas diff` is right on all."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--pairs", type=int, default=100)
    options.add_argument("--parallel", type=int, default=1, help="pairs at once")
    options.add_argument("--faults", default="*", metavar="PATTERN", help="only mutants whose names match")
    options.add_argument("--skip", type=int, default=0, help="leave out the first so many of the sample")
    options.add_argument("--seed", type=int, default=0, help="of the sample")
    given = options.parse_args()
    sample = _sample(given.faults, given.seed)[given.skip :]
    started = time.monotonic()
    judged: list[Pair] = []
    with tempfile.TemporaryDirectory() as folder, RobotPool(Contract.load(), BAROQUE, given.parallel) as pool:
        pairs = _Pairs(pool, Path(folder))
        with ThreadPoolExecutor(given.parallel) as executor:
            # What turns out to be no pair is made up for by the next of the sample.
            while sample and len(judged) < given.pairs:
                missing = given.pairs - len(judged)
                batch, sample = sample[:missing], sample[missing:]
                for pair in executor.map(pairs.judge, batch):
                    if not pair.none:
                        judged.append(pair)
                    print(f"[{len(judged)}/{given.pairs}] {pair.mutant.name}: {pair.told}", flush=True)
    right = sum(not pair.problems for pair in judged)
    classes = {id_.partition("/")[0] for pair in judged for id_ in pair.mutant.catches}
    alone = sum(not pair.others for pair in judged)
    print(f"{right} of {len(judged)} pairs right, there and back, over {len(classes)} classes; in {alone} the fault")
    print(f"breaks nothing beside what it is made to break; {time.monotonic() - started:.0f} s")
    return right < len(judged)


def _sample(pattern: str, seed: int) -> list[Mutant]:
    """Return mutants that need no ROS, from all classes in turn."""
    by_class: dict[str, list[Mutant]] = defaultdict(list)
    for mutant in MUTANTS:
        if not mutant.probe and fnmatch.fnmatch(mutant.name, pattern):
            by_class[mutant.catches[0].partition("/")[0]].append(mutant)
    chance = random.Random(seed)  # noqa: S311 - a sample, and no secret
    for mutants in by_class.values():
        chance.shuffle(mutants)
    turns = itertools.zip_longest(*(by_class[name] for name in Contract.load().classes if name in by_class))
    return [mutant for turn in turns for mutant in turn if mutant is not None]


@dataclass(frozen=True)
class Pair:
    """The outcome of a pair.

    Attributes:
        problems: what is wrong with the differences.
        others: requirements that broke besides those that the mutant is made to break.
        none: why the two results show nothing, or empty.
    """

    mutant: Mutant
    problems: tuple[str, ...] = ()
    others: frozenset[str] = frozenset()
    none: str = ""

    @property
    def told(self) -> str:
        """Return the outcome as a line of text."""
        if self.none:
            return f"no pair: {self.none}"
        others = f" (the fault breaks {', '.join(sorted(self.others))} as well)" if self.others else ""
        return ("; ".join(self.problems) or f"right: {', '.join(self.mutant.catches)}") + others


class _Pairs:
    """Judges pairs; the good robot's result for a set of classes is kept for later pairs with the same classes."""

    def __init__(self, pool: RobotPool, folder: Path) -> None:
        self._pool, self._folder = pool, folder
        self._numbers = itertools.count()
        self._good_ones = threading.Lock()

    def judge(self, mutant: Mutant) -> Pair:
        """Judge both robots, and compare their results in both directions."""
        robot, proxy = self._pool.take()
        try:
            for effort in ("quick", "standard"):  # as in the self-test: what a few cases missed is tried with more
                good = self._good(mutant, robot, proxy, effort)
                become(proxy, mutant)
                faulty = self._certify(mutant, robot, proxy, effort)
                _undo(proxy)
                if set(mutant.catches) <= _with(_verdicts(faulty), _BROKEN):
                    break
            return _compare(mutant, good, faulty)
        finally:
            self._pool.give(robot, proxy)

    def _good(self, mutant: Mutant, robot: Robot, proxy: Proxy, effort: str) -> Path:
        kept = self._folder / f"good-{effort}-{'-'.join(_classes(mutant))}"
        with self._good_ones:
            if not (kept / "result.json").exists():
                self._certify(mutant, robot, proxy, effort).rename(kept)
        return kept

    def _certify(self, mutant: Mutant, robot: Robot, proxy: Proxy, effort: str) -> Path:
        out = self._folder / str(next(self._numbers))
        job = job_for(robot, proxy, effort, 0, classes=_classes(mutant), token=mutant.token, out=out)
        run_job(replace(job, timeout_s=_RUN_S))
        return out


def _undo(proxy: Proxy) -> None:
    proxy.change, proxy.incomplete_request = unchanged, None
    proxy.serial = proxy.backwards = proxy.forgetful = False


def _compare(mutant: Mutant, good: Path, faulty: Path) -> Pair:
    before, now = _verdicts(good), _verdicts(faulty)
    broken = {id_ for id_ in _with(now, _BROKEN) if before[id_] not in _BROKEN}
    if any(before[id_] in _BROKEN for id_ in mutant.catches):
        return Pair(mutant, none="the good robot itself does not pass it, as it may a SHOULD")
    if not broken.issuperset(mutant.catches):
        return Pair(mutant, none="the mutant survived, which is for `roaas selftest` to say")
    problems: list[str] = []
    for there, (old, new) in {"there": (good, faulty), "back": (faulty, good)}.items():
        problems += [f"{there}: {problem}" for problem in _wrong(_diff(old, new), _verdicts(old), _verdicts(new))]
    return Pair(mutant, tuple(problems), frozenset(broken - set(mutant.catches)))


def _wrong(answer: Answer, old: dict[str, str], new: dict[str, str]) -> list[str]:
    """Return the differences between the output of `roaas diff` and the verdicts in the two files."""
    wanted = {
        _FAILURES: {id_ for id_ in new if new[id_] == "fail" and old[id_] not in _BROKEN},
        _WARNINGS: {id_ for id_ in new if new[id_] == "warn" and old[id_] not in _BROKEN},
        _FIXED: {id_ for id_ in new if new[id_] == "pass" and old[id_] in _BROKEN},
    }
    problems = [
        f"{heading} are {sorted(answer.named.get(heading, set()))} and should be {sorted(ids)}"
        for heading, ids in wanted.items()
        if answer.named.get(heading, set()) != ids
    ]
    # What passed and is not judged any more is a regression of its own kind, where it is a MUST.
    lost = {id_ for id_ in new if old[id_] == "pass" and new[id_] not in {"pass", *_BROKEN}}
    if answer.named.get("Lost coverage", set()) != lost:
        problems.append(f"lost coverage is {sorted(answer.named.get('Lost coverage', set()))}, not {sorted(lost)}")
    if not lost and answer.exit_code != bool(wanted[_FAILURES]):
        problems.append(f"exit code {answer.exit_code}")
    return problems


def _diff(old: Path, new: Path) -> Answer:
    done = CliRunner().invoke(diff, [str(old), str(new)])
    named: dict[str, set[str]] = defaultdict(set)
    heading = ""
    for line in done.stdout.splitlines():
        if found := _HEADING.match(line):
            heading = found[1]
        elif found := _LINE.match(line):
            named[heading].add(found[1])
    return Answer(done.exit_code, dict(named))


def _classes(mutant: Mutant) -> tuple[str, ...]:
    return tuple(dict.fromkeys(id_.partition("/")[0] for id_ in mutant.catches))


def _verdicts(folder: Path) -> dict[str, str]:
    document = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return {item["id"]: item["verdict"] for item in document["requirements"]}


def _with(verdicts: dict[str, str], which: tuple[str, ...]) -> set[str]:
    return {id_ for id_, verdict in verdicts.items() if verdict in which}


if __name__ == "__main__":
    sys.exit(main())
