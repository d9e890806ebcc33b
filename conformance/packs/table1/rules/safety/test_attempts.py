"""Rules on requests that must not move a robot at rest: the generic ones, under this contract's requirements."""

from collections.abc import Iterator

from conformance.packs.table1.robot.motion_map import motion_map_of
from conformance.packs.table1.scenarios.attempts import attempts
from conformance.packs.table1.statement import said_of
from conformance.rules.motion.test_motion_attempts import incomplete_still, judge_refused, nothing_moved, refused_still
from conformance.scenarios.motion.trace import Quiet
from conformance.scenarios.rule import NotClaimed, Note, Outcome, rule
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run


@rule("safety/limits-refused", on=(attempts,))
def limits_refused(trace: Quiet) -> Iterator[Outcome]:
    """Judge that a velocity beyond the limits is rejected with 4xx."""
    return judge_refused(attempt for attempt in trace.tried if attempt.kind == "beyond")


@rule("safety/refused-keeps", on=(attempts,))
def refused_keeps(trace: Quiet, run: Run) -> Iterator[Outcome]:
    """Judge that the robot stays at rest after each rejected velocity."""
    yield from refused_still.judge(trace, motion_map_of(said_of(run)))


@rule("safety/limits-hold", on=(attempts,))
def limits_hold(trace: Quiet, run: Run) -> Iterator[Outcome]:
    """Judge that a robot without declared limits does not drive at a velocity that no robot reaches."""
    limits = said_of(run).limits
    if not (limits.linear_declared and limits.angular_declared):
        yield from _nothing_moved(trace, run, "beyond")


@rule("safety/unactuated-refused", on=(attempts,))
def unactuated_refused(trace: Quiet) -> Iterator[Outcome]:
    """Judge that a velocity in a component that the robot does not actuate is rejected with 4xx."""
    yield from judge_refused(attempt for attempt in trace.tried if attempt.kind == "unactuated")
    driven = [attempt for attempt in trace.tried if attempt.kind == "driven"]
    for attempt in driven:
        yield Case(True, attempt.exchange, f"4xx for {attempt.what}, or that it drives so")
        yield Note("the robot reaches a velocity that its statement leaves out")
    if not driven and all(attempt.kind != "unactuated" for attempt in trace.tried):
        yield NotClaimed("does not apply: by its statement the robot actuates all six components, so each is driven")


@rule("safety/client-vanished", on=(attempts,))
def client_vanished(trace: Quiet, run: Run) -> Iterator[Outcome]:
    """Judge that the robot is at rest after requests of which some bytes did not arrive."""
    yield from incomplete_still.judge(trace, motion_map_of(said_of(run)))


@rule("safety/cancel", on=(attempts,))
def cancel_stays(trace: Quiet, run: Run) -> Iterator[Outcome]:
    """Judge that the robot stays where it is, without a goal, after its goal was cancelled."""
    return _nothing_moved(trace, run, "cancelled")


@rule("http/not-acceptable-undone", on=(attempts,))
def not_acceptable_undone(trace: Quiet, run: Run) -> Iterator[Outcome]:
    """Judge that the robot is at rest, without a goal, after PUTs that it answered 406."""
    return _nothing_moved(trace, run, "not acceptable")


def _nothing_moved(trace: Quiet, run: Run, kind: str) -> Iterator[Outcome]:
    if any(attempt.kind == kind for attempt in trace.tried):
        yield from nothing_moved(trace, motion_map_of(said_of(run)), kind)
    else:
        yield Note(f"no attempt of this kind was made: {kind}")
