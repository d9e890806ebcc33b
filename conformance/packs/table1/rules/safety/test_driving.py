"""Rules on safety: of drives, of requests that must not move a robot at rest, and of clients that vanish.

A velocity holds for its time, ends by itself, and can be renewed and stopped.
"""

from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Final

import pytest

from conformance.packs.table1.robot.drive_rules import Driven, longer_s, outcomes, rule_on
from conformance.packs.table1.robot.drive_trace import JUDGED, LONGEST_SAMPLE_S
from conformance.packs.table1.robot.goal_trace import Cancelled, GoalLife, GoalReached
from conformance.packs.table1.robot.motion_map import motion_map_of, velocity_of
from conformance.packs.table1.robot.robot import GOAL_PATH, POSE, STILL, VELOCITY, Robot, is_near
from conformance.packs.table1.scenarios.attempts import attempts
from conformance.packs.table1.scenarios.goal_life import goal_life
from conformance.packs.table1.scenarios.goal_reached import goal_reached
from conformance.packs.table1.scenarios.turn import further_axes, straight, turn
from conformance.packs.table1.scenarios.walks import velocity_walk
from conformance.packs.table1.statement import said_of
from conformance.rules.motion import test_velocities as generic
from conformance.rules.motion.judging import judge_renewed
from conformance.rules.motion.test_motion_attempts import incomplete_still, judge_refused, nothing_moved, refused_still
from conformance.rules.motion.test_velocities import fails, judge_hold
from conformance.scenarios.motion.trace import Drive, Quiet
from conformance.scenarios.rule import NotClaimed, Note, NotTested, Outcome, rule
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Unanswered
from conformance.transport.raw import PartialRequest
from conformance.verdict.evidence import Case, Judge
from conformance.verdict.run import Run

# Time beyond the settle time in which a stop must be answered, s: a robot may wait until it rests.
_ANSWERED_S: Final = 1.0
_USUAL: Final = 4  # usual response times added for the network
# Late responses that are the robot's fault.
_LATE_RESPONSES: Final = 2
# Tolerances by which a held velocity may be off.
_OFF: Final = 1.5


# A velocity of 0 stops the robot before its watchdog does.
stop = rule_on("safety/stop", straight, turn, further_axes, velocity_walk)
limits_hold = rule_on("safety/limits-hold", straight, turn, further_axes, velocity_walk)
refused_keeps = rule_on("safety/refused-keeps", velocity_walk)


@rule("safety/renewal", on=(turn,))
def renewal(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that a velocity lasts as long as it is renewed."""
    yield from outcomes("safety/renewal", trace.drive, said_of(run).limits)
    motion, found = motion_map_of(said_of(run)), list[Outcome]()
    for drive in _let_go(trace):
        if drive.was_kept(said_of(run).limits.hold_s):
            found += (
                one for name, wanted in drive.wanted.items() for one in judge_renewed(drive, name, wanted, motion)
            )
    yield from found or [NotTested("no velocity was renewed in time: it was refused, or responses came too late")]


@rule("safety/refused-keeps", on=(turn,))
def refused_keeps_under_way(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that refused velocities do not end an accepted one, if it lasts without them."""
    motion = motion_map_of(said_of(run))
    disturbed, alone = _apart(trace)
    if not fails(judge_hold(alone[:1], motion, JUDGED)):
        yield from judge_hold(disturbed, motion, JUDGED)


@rule("safety/hold", on=(turn, further_axes))
def hold(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that a velocity that is not renewed lasts for the hold time."""
    disturbed, alone = _apart(trace)
    return judge_hold(alone or disturbed, motion_map_of(said_of(run)), JUDGED)


@rule("safety/watchdog", on=(turn, further_axes))
def watchdog(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the robot comes to rest whenever a velocity is not renewed."""
    yield from generic.watchdog.judge(_let_go(trace), motion_map_of(said_of(run)))


@rule("safety/hold-ends", on=(turn, further_axes))
def hold_ends(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the robot begins to stop at the end of the hold time."""
    limits = said_of(run).limits
    for drive in _let_go(trace):
        last = drive.commands[-1]
        longest_s = (limits.hold_s or 0.0) + longer_s(limits) + 2 * _period_s(drive)
        wanted = velocity_of(drive.wanted)
        late = [
            reading
            for reading in drive.after
            if reading.sent > last.answered + longest_s
            and reading.speeds
            and is_near(limits, velocity_of(reading.speeds), wanted, _OFF)
        ]
        seen = (late or drive.after)[-1]
        yield Case(
            not late,
            seen.exchange,
            f"a robot that begins to stop {limits.hold_s:g} s after {drive.name}, by {longest_s:.2f} s at the latest",
            f"{velocity_of(seen.speeds)} {seen.sent - last.answered:.2f} s after the command",
            "holds too long",
        )


def _let_go(trace: Driven) -> tuple[Drive, ...]:
    """Return the drives that were let go and whose commands were accepted; others are judged by their responses."""
    return tuple(drive for drive in trace.let_go if drive.after and all(command.is_ok for command in drive.commands))


def _apart(trace: Driven) -> tuple[tuple[Drive, ...], tuple[Drive, ...]]:
    """Return the drives during which the robot refused further velocities, and the other drives."""
    drives = _let_go(trace)
    return tuple(drive for drive in drives if drive.refused), tuple(drive for drive in drives if not drive.refused)


def _period_s(drive: Drive) -> float:
    """Return the time from one odometry sample to the next, s."""
    seen = [reading for reading in drive.under_way if reading.stamp is not None]
    stamps = {reading.stamp for reading in seen}
    lasted_s = seen[-1].sent - seen[0].sent if seen else 0.0
    return min(lasted_s / max(1, len(stamps) - 1), LONGEST_SAMPLE_S)


@rule("safety/cancel", on=(goal_life,))
def cancel(trace: GoalLife, run: Run) -> Iterator[Outcome]:
    """Judge that the robot stands still after its goal was cancelled."""
    for cancellation in judged_cancels(trace):
        yield from outcomes("safety/cancel", cancellation.drive, said_of(run).limits)


def judged_cancels(trace: GoalLife) -> tuple[Cancelled, ...]:
    """Return the cancels that are judged.

    Where a response was late, the DELETE may have been late on its way to the robot as well: another one is judged.
    """
    return tuple(cancellation for cancellation in trace.cancelled if not cancellation.late) or trace.cancelled[-1:]


@rule("safety/stop-answered", on=(straight,))
def stop_answered(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge how long the responses to zero velocity take."""
    stops = [command.exchange for command in trace.drive.commands if command.velocity == STILL and not command.renewal]
    return answered_in_time(stops, run)


@rule("safety/stop-answered", on=(goal_life,))
def cancel_answered(trace: GoalLife, run: Run) -> Iterator[Outcome]:
    """Judge how long the responses to DELETE of the active goal take."""
    return answered_in_time(trace.cancels, run)


def answered_in_time(exchanges: Sequence[Exchange], run: Run) -> Iterator[Outcome]:
    """Judge that at most one response takes too long: a network may lose one request, and its sender sends it again."""
    longest_s = said_of(run).limits.settle_s + _ANSWERED_S + _USUAL * run.effort.usual_ms / 1000
    late = [exchange for exchange in exchanges if exchange.response.elapsed_ms / 1000 > longest_s]
    if len(late) == len(exchanges) == 1:
        yield NotTested("the only response was late, which may be the network's doing")
    elif exchanges:
        seen = (late or exchanges)[-1]
        took = f"a response after {seen.response.elapsed_ms / 1000:.1f} s, {len(late)} of {len(exchanges)} times late"
        yield Case(len(late) < _LATE_RESPONSES, seen, f"a response within {longest_s:.1f} s", took, "late")


@rule("safety/watchdog", on=(goal_reached,))
def not_taken_up(trace: GoalReached, run: Run) -> Iterator[Outcome]:
    """Judge that the robot does not resume an old velocity when it has reached a goal."""
    if trace.turned is not None:
        yield from outcomes("safety/watchdog", trace.turned, said_of(run).limits)


@rule("safety/limits-refused", on=(attempts,))
def limits_refused(trace: Quiet) -> Iterator[Outcome]:
    """Judge that a velocity beyond the limits is rejected with 4xx."""
    return judge_refused(attempt for attempt in trace.tried if attempt.kind == "beyond")


@rule("safety/refused-keeps", on=(attempts,))
def refused_keeps_at_rest(trace: Quiet, run: Run) -> Iterator[Outcome]:
    """Judge that the robot stays at rest after each rejected velocity."""
    yield from refused_still.judge(trace, motion_map_of(said_of(run)))


@rule("safety/limits-hold", on=(attempts,))
def limits_hold_at_rest(trace: Quiet, run: Run) -> Iterator[Outcome]:
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


# Least usual response time to assume, s: scheduling on a busy machine is no failure.
_PATIENT_S: Final = 1.0
# Tries: a network may delay one response, but a robot that waits for other requests never responds to the third.
_TRIES: Final = 3


@pytest.mark.needs("rest")
@pytest.mark.phase("reading")
@pytest.mark.requirement("safety/half-request")
def test_half_requests(robot: Robot, rest: HttpClient, judge: Judge) -> None:
    """Send other requests while three requests are incomplete: the robot must respond within the usual time."""
    patience_s = max(_PATIENT_S, 20 * robot.usual_s)
    judge.at_risk = ("safety/half-request",)
    with (
        PartialRequest(rest, "GET", POSE, head_only=20),
        PartialRequest(rest, "GET", POSE, head_only=-2),
        PartialRequest(rest, "OPTIONS", GOAL_PATH, sent=b"{", promised=100),
    ):
        expected = f"a response within {patience_s:g} s while three other requests are incomplete"
        for path in (POSE, VELOCITY, POSE):
            attempt = _send(rest, path, patience_s)
            answered = isinstance(attempt, Exchange)
            if not judge.check("safety/half-request", answered, attempt, expected):
                return


def _send(client: HttpClient, path: str, patience_s: float) -> Attempt:
    """Send a GET, again if its response does not come in time, and return the last attempt."""
    attempt = _send_once(client, path, patience_s)
    for _ in range(_TRIES - 1):
        if isinstance(attempt, Unanswered) and attempt.kind is NoAnswer.TIMEOUT:
            attempt = _send_once(client, path, patience_s)
    return attempt


def _send_once(client: HttpClient, path: str, patience_s: float) -> Attempt:
    # A new client, because a hang here says nothing about later requests. A new connection, because an open one may be
    # served by its own thread.
    with closing(HttpClient(client.base_url, client.connection)) as other:
        try:
            return other.send("GET", path, fresh=True, timeout_s=patience_s)
        except NoAnswerError as none:
            return none.unanswered
