"""Which faults of a robot's behaviour the suite detects, as opposed to changes of its messages by a proxy.

``python benchmarks/inside.py`` certifies the independent robot ``baroque`` with each of its faulty bodies, and once
without a fault. It prints a line for each and how many faults were detected; ``python benchmarks/inside.py 'goal-*'``
takes the matching faults. No ROS is needed. ``python -m proof.table1.independent_robots baroque --fault
deadband`` starts such a robot by hand. The exit code is 1 when the robot without a fault does not pass, 2 when no fault
has such a name.
"""

import argparse
import signal
import sys
from fnmatch import fnmatch

from conformance.commandline.exit_codes import ExitCode
from conformance.contract.pack import Contract
from conformance.verdict.effort import EFFORTS
from proof.selftest.at_once import each_at_once
from proof.selftest.certifying import Outcome, job_at, run_job
from proof.selftest.robots import running
from proof.table1.faulty_bodies import FAULTY_BODIES, UNSEEN
from proof.table1.selftest import with_fault

_NO_FAULT = ""
_TIMEOUT_S = 300.0


def main() -> int:
    """Certify the robots, print the results, and return the exit code."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("patterns", nargs="*", default=["*"], metavar="PATTERN", help="names of faults; default: all")
    parser.add_argument("--effort", choices=EFFORTS, default="quick")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--parallel", type=int, default=2, help="robots at once")
    options = parser.parse_args()
    names = [name for name in FAULTY_BODIES if any(fnmatch(name, pattern) for pattern in options.patterns)]
    if not names:
        parser.error(f"no fault is named {' or '.join(options.patterns)}; there are {', '.join(FAULTY_BODIES)}")

    def certify(fault: str) -> tuple[str, Outcome]:
        with running(Contract.load(), with_fault(fault)) as robot:
            job = job_at(robot, effort=options.effort, seed=options.seed, timeout_s=_TIMEOUT_S)
            return fault, run_job(job)

    try:
        found = dict(each_at_once(certify, [_NO_FAULT, *names], options.parallel, _tell))
    except KeyboardInterrupt:
        return 130
    caught = sum(_detected(name, found[name]) for name in names if name in found)
    print(f"killed {caught} of {len(names)} at {options.effort}, seed {options.seed}")
    return int(found[_NO_FAULT].exit_code != ExitCode.PASSED)


def _detected(fault: str, outcome: Outcome) -> bool:
    return bool(outcome.fails) or (fault in UNSEEN and outcome.exit_code != ExitCode.PASSED)


def _tell(result: tuple[str, Outcome]) -> None:
    fault, outcome = result
    said = f"killed by {', '.join(sorted(outcome.fails)[:3])}" if outcome.fails else f"exit code {outcome.exit_code}"
    print(f"{fault or 'no fault'}: {said} ({outcome.seconds:.0f} s)", flush=True)


if __name__ == "__main__":
    sys.exit(main())
