"""Whether the verdict on a good robot depends on chance: many seeds, over links and on a busy machine.

``python benchmarks/verdicts.py --robot reference --seeds 30 --busy 2`` certifies the reference robot with 30 seeds, one
after another, while two loops keep the processors busy. It prints a line for each run and a table at the end. With
``--link`` the clients reach the robot over such a link; ``--robot realistic`` is another robot for each seed. Both may
be repeated: every robot is tried over every link. The exit code is 0 when no robot failed, at most one run in twenty
was undecided, and there was a run; 1 otherwise; 130 when it was interrupted.
"""

import argparse
import contextlib
import itertools
import multiprocessing
import os
import signal
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator

from conformance.contract.pack import Contract
from conformance.mutation.self_test import self_test_of
from conformance.packs.table1.selftest import REFERENCE
from conformance.selftest.controls import Case, ControlResult, run_controls
from conformance.selftest.link import LINKS
from conformance.selftest.robots import RobotError
from conformance.selftest.variants import VARIANTS, Variant
from conformance.verdict.effort import EFFORTS

NO_LINK = "none"
# The worst that may be undecided: of twenty runs one.
UNDECIDED_SHARE = 0.05
_CONFORMANT, _NOT_CONFORMANT = 0, 1
_NAMED = 5  # requirements of one reason; more are counted


def main() -> int:
    """Certify the robots, print the results, and return the exit code."""
    # What ends a CI job takes the robots with it, like Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    options = _parser().parse_args()
    robots, links = options.robot or [REFERENCE.name], options.link or [NO_LINK]
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    contract = Contract.load()
    device = self_test_of(contract).device
    cases = [
        Case(device(robot), _link(name), seed) for robot, name in itertools.product(robots, links) for seed in seeds
    ]
    until = time.monotonic() + 60 * options.minutes
    results: list[ControlResult] = []
    interrupted = False
    print(f"{len(cases)} runs at {options.effort}, {options.busy} busy loops on {os.cpu_count()} processors")
    with _busy(options.busy):
        try:
            for case in cases:
                if time.monotonic() > until:
                    print(f"{len(cases) - len(results)} runs left out: {options.minutes:g} minutes are over")
                    break
                results += run_controls(
                    contract, [case], effort=options.effort, parallel=1, domain_id=options.domain_id, tell=_tell
                )
        except RobotError as error:
            print(error, file=sys.stderr)
            return _NOT_CONFORMANT
        except KeyboardInterrupt:
            interrupted = True
    print(_table(results))
    if interrupted:
        return 130
    tried = [result for result in results if result.outcome is not None]
    undecided = sum(_word(result) == "undecided" for result in tried)
    false = any(_word(result) == "false positive" for result in tried)
    return int(not tried or false or undecided > max(1, UNDECIDED_SHARE * len(tried)))


def _parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    robots = [device.name for device in self_test_of(Contract.load()).devices]
    options.add_argument("--robot", action="append", choices=robots, help="default: reference")
    links = [NO_LINK, *(link.name for link in LINKS)]
    options.add_argument("--link", action="append", choices=links, help="default: none")
    options.add_argument("--seeds", type=_from(1), default=30, help="runs of each robot over each link")
    options.add_argument("--first-seed", type=_from(0), default=0)
    options.add_argument("--effort", choices=EFFORTS, default="quick")
    options.add_argument("--busy", type=_from(0), default=0, help="loops that keep processors busy meanwhile")
    options.add_argument("--minutes", type=float, default=240.0, help="after which no further run is begun")
    options.add_argument("--domain-id", type=_from(0), default=70, help="first ROS domain to use")
    return options


def _from(least: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        value = int(text)
        if value < least:
            raise argparse.ArgumentTypeError(f"{value} is less than {least}")
        return value

    return whole


def _link(name: str) -> Variant | None:
    return next((one for one in VARIANTS if one.link is not None and one.name == name), None)


@contextlib.contextmanager
def _busy(count: int) -> Iterator[None]:
    """Keep so many processors busy while the context lasts."""
    loops = [multiprocessing.get_context("spawn").Process(target=_spin, daemon=True) for _ in range(count)]
    for loop in loops:
        loop.start()
    try:
        yield
    finally:
        for loop in loops:
            loop.terminate()
            loop.join()


def _spin() -> None:
    """Count, until the parent ends this process or is gone."""
    parent = os.getppid()
    while os.getppid() == parent:
        for _ in range(1_000_000):
            pass


def _word(result: ControlResult) -> str:
    """Return the outcome of a run in a word."""
    if result.outcome is None:
        return "not tried"
    if result.false_positives or result.outcome.exit_code == _NOT_CONFORMANT:
        return "false positive"
    return "conformant" if result.outcome.exit_code == _CONFORMANT else "undecided"


def _warned(result: ControlResult) -> dict[str, str]:
    """Return the requirements that only warn, with their reasons."""
    outcome = result.outcome
    return {id_: outcome.reasons[id_] for id_, word in outcome.verdicts.items() if word == "warn"} if outcome else {}


def _tell(result: ControlResult) -> None:
    word = _word(result)
    why = result.false_positives or (result.unjudged if word == "undecided" else {})
    seconds = f"{result.outcome.seconds:.1f} s" if result.outcome else result.not_tried
    print(f"{result.robot} {result.variant or NO_LINK} seed {result.seed}: {word}, {seconds}", flush=True)
    for kind, said in (("", why), ("warns: ", _warned(result))):
        by_reason: dict[str, list[str]] = {}
        for id_, reason in said.items():
            by_reason.setdefault(reason, []).append(id_)
        for reason, ids in by_reason.items():
            # A run that broke off says one thing of all of them.
            who = ", ".join(ids) if len(ids) <= _NAMED else f"{len(ids)} requirements"
            print(f"  {kind}{who}: {reason[:300]}", flush=True)


def _table(results: list[ControlResult]) -> str:
    """Return a Markdown table with a line for each robot and link."""
    columns = ("robot", "link", "runs", "conformant", "false", "undecided", "verdicts", "median s", "longest s")
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for (robot, link), group in itertools.groupby(results, lambda one: (one.robot, one.variant)):
        found = list(group)
        words = Counter(map(_word, found))
        outcomes = [one.outcome for one in found if one.outcome is not None]
        # Runs of one verdict say the same of each requirement.
        verdicts = {tuple(sorted(outcome.verdicts.items())) for outcome in outcomes}
        seconds = [outcome.seconds for outcome in outcomes] or [0.0]
        cells = (
            robot, link or NO_LINK, len(found), words["conformant"], words["false positive"], words["undecided"],
            f"{len(verdicts)} different", f"{statistics.median(seconds):.1f}", f"{max(seconds):.1f}",
        )  # fmt: skip
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
