"""How reliably the suite detects an intermittent fault: one at random, in one of sixty responses.

``python benchmarks/intermittent.py`` certifies the reference robot behind a proxy with each kind of fault. It prints a
line for each run and how many faults were detected; a run ends with the first MUST that fails. ``python
benchmarks/intermittent.py 'pose-*' --once-in 200`` takes some faults, which strike more rarely. The exit code is 0 when
at least 19 of 20 runs detected theirs, 1 when they did not or no fault has such a name, 130 when it was interrupted.
"""

import argparse
import random
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

from programs import matching

from conformance.contract.classes import Level
from conformance.contract.pack import Contract
from conformance.verdict.effort import EFFORTS
from proof.mutation.changes import (
    Make,
    Where,
    altered,
    hanging_up,
    instead,
    page,
    plain,
    posted,
    problem,
    rest,
    soap,
    text,
    values,
)
from proof.mutation.messages import Forward, Request, Response
from proof.selftest.at_once import each_at_once
from proof.selftest.certifying import Outcome, run_job
from proof.selftest.mutant_run import RobotPool, job_for
from proof.table1.mutants.paths import GOAL, PLAN, POSE, SENSORS, VELOCITY, deliveries
from proof.table1.selftest import REFERENCE

# What the suite is to reach.
_CAUGHT_SHARE = 0.95
_OOPS = page(500, b"oops", "text/plain")


class Sometimes:
    """A change to randomly chosen responses, one in so many of those that the change can affect.

    Attributes:
        concerned: number of requests whose response could have been changed.
        strikes: number of changed responses.
    """

    def __init__(self, where: Where, make: Make, once_in: int, seed: str) -> None:
        self._where, self._change = where, make()
        self._once_in, self._random = once_in, random.Random(seed)  # noqa: S311 - no secret
        self._lock = threading.Lock()
        self.concerned = self.strikes = 0

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Forward a request, and return the response, changed or not."""
        if not self._where(request):
            return forward(request)
        with self._lock:
            strikes = self._random.random() * self._once_in < 1
            self.concerned += 1
            self.strikes += strikes
        return self._change(request, forward) if strikes else forward(request)


class _Stale:
    """A change that returns the response to the previous identical request."""

    def __init__(self) -> None:
        self._answers: dict[tuple[str, str | None], Response] = {}

    def __call__(self, request: Request, forward: Forward) -> Response:
        answer, key = forward(request), (request.target, request.field("Accept"))
        before = self._answers.get(key, answer)
        self._answers[key] = answer.copy()
        return before.copy()


def _any(_request: Request) -> bool:
    return True


def _edited(edit: Callable[[Response], object]) -> Make:
    return altered(_any, edit)


def _moved(by: float) -> Callable[[dict[str, float]], None]:
    return lambda point: point.update(x=point["x"] + by)


def _halved(response: Response) -> None:
    response.body = response.body[: len(response.body) // 2]


def _plan_aside(answer: Any) -> None:
    poses = answer["plan"]["poses"]
    _moved(1.5)(poses[len(poses) // 2]["pose"]["position"])


_GOAL_PUT = rest("PUT", GOAL)
# Each: which requests it concerns, and what becomes of them.
FAULTS: dict[str, tuple[Where, Make]] = {
    "get-500": (rest("GET"), _edited(_OOPS)),
    "put-500": (rest("PUT"), _edited(_OOPS)),
    "soap-500": (posted, _edited(_OOPS)),
    "get-cut": (rest("GET"), _edited(_halved)),
    "soap-cut": (posted, _edited(_halved)),
    "hang-up": (rest("GET"), hanging_up(_any)),
    "stale": (rest("GET", POSE, VELOCITY), _Stale),
    "pose-aside": (rest("GET", POSE), _edited(values(lambda told: _moved(1.0)(told["pose"]["pose"]["position"])))),
    "velocity-off": (rest("GET", VELOCITY), _edited(values(lambda told: _moved(0.1)(told["linear"])))),
    "velocity-zero": (
        rest("GET", VELOCITY),
        _edited(values(lambda told: {part: dict.fromkeys(told[part], 0.0) for part in told})),
    ),
    "velocity-lost": (rest("PUT", VELOCITY), instead(_any, plain(204))),
    "goal-404": (rest("GET", GOAL), instead(_any, problem(404, "no goal"))),
    "goal-other": (
        rest("GET", GOAL),
        _edited(values(lambda told: _moved(0.5)(told["goal"]["target_pose"]["pose"]["position"]))),
    ),
    "goal-lost": (lambda request: _GOAL_PUT(request) and b"goal" in request.body, instead(_any, plain(201))),
    "plan-aside": (rest("GET", PLAN), _edited(values(_plan_aside))),
    "sensors-short": (rest("GET", SENSORS), _edited(values(lambda told: told[:-1]))),
    "delivery-lost": (deliveries, instead(_any, plain(204))),
    "soap-velocity-off": (soap("GetVelocity"), _edited(text(r"(<(?:\w+:)?x>)[^<]+", r"\g<1>0.1", count=1))),
    "soap-pose-aside": (soap("GetPose"), _edited(text(r"(<(?:\w+:)?x>)[^<]+", r"\g<1>77.7", count=1))),
}


def main() -> int:
    """Certify the robots, print the results, and return the exit code."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("patterns", nargs="*", default=["*"], metavar="PATTERN", help="names of faults; default: all")
    parser.add_argument("--effort", choices=EFFORTS, default="standard")
    parser.add_argument("--seeds", type=int, default=1, help="of each fault")
    parser.add_argument("--once-in", type=int, default=60, metavar="N", help="it strikes once in so many; default: 60")
    parser.add_argument("--parallel", type=int, default=2, help="robots at once")
    parser.add_argument("--domain-id", type=int, default=80, help="ROS domain of the first robot")
    options = parser.parse_args()
    names = matching(options.patterns, FAULTS)
    if not names:
        return 1
    contract = Contract.load()
    must = frozenset(id_ for id_, one in contract.ledger.items() if one.level is Level.MUST)
    runs = [(name, seed) for name in names for seed in range(options.seeds)]
    with RobotPool(contract, REFERENCE, min(options.parallel, len(runs)), options.domain_id) as pool:

        def certify(run: tuple[str, int]) -> bool:
            name, seed = run
            robot, proxy = pool.take()
            try:
                where, make = FAULTS[name]
                proxy.change = fault = Sometimes(where, make, options.once_in, f"{name}/{seed}")
                job = job_for(robot, proxy, options.effort, seed, domain_id=robot.domain_id, enough=must)
                outcome = run_job(job)
                return _told(f"{name}, seed {seed}", fault, outcome, must, proxy.broken)
            finally:
                pool.give(robot, proxy)

        try:
            caught = each_at_once(certify, runs, pool.size, lambda _: None)
        except KeyboardInterrupt:
            return 130
    print(f"killed {sum(caught)} of {len(runs)} at {options.effort}, one answer in {options.once_in}")
    return int(sum(caught) < _CAUGHT_SHARE * len(runs))


def _told(run: str, fault: Sometimes, outcome: Outcome, must: frozenset[str], broken: list[str]) -> bool:
    """Print the outcome of one run; return whether its fault was detected."""
    failed = sorted(must & set(outcome.fails)) or sorted(outcome.not_passed())
    said = f"killed by {', '.join(failed[:3])}" if failed else f"survived, exit code {outcome.exit_code}"
    if broken:  # it did not do what its name says
        said, failed = f"void: {broken[0]}", []
    print(f"{run}: {said} ({fault.strikes} of {fault.concerned} struck, {outcome.seconds:.0f} s)", flush=True)
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
