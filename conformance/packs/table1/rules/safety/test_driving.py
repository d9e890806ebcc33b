"""Rules on the safety of drives: a velocity holds for its time, ends by itself, can be renewed and stopped."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Final

from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.goal_trace import Cancelled, GoalLife, GoalReached
from conformance.packs.table1.robot.robot import STILL
from conformance.packs.table1.scenarios.goal_life import goal_life
from conformance.packs.table1.scenarios.goal_reached import goal_reached
from conformance.packs.table1.scenarios.standing import later
from conformance.packs.table1.scenarios.straight import straight
from conformance.packs.table1.scenarios.trace import Driven, shown
from conformance.packs.table1.scenarios.turn import further_axes, turn
from conformance.packs.table1.scenarios.velocity_walk import velocity_walk
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Note, NotTested, Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

# Time beyond the settle time in which a stop must be answered, s: a robot may wait until it rests. Usual response times
# that are added for the network.
_ANSWERED_S: Final = 1.0
_USUAL: Final = 4
# Late responses that are the robot's fault.
_LATE_RESPONSES: Final = 2
_LATE = NotTested("responses came too late to measure how long a velocity holds")


# Zero velocity stops the robot before its watchdog would.
stop = shown("safety/stop", straight, turn, further_axes, velocity_walk)
limits_hold = shown("safety/limits-hold", straight, turn, further_axes, velocity_walk)
refused_keeps = shown("safety/refused-keeps", turn, velocity_walk)


@rule("safety/renewal", on=(turn,))
def renewal(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that a velocity lasts as long as it is renewed."""
    yield from outcomes("safety/renewal", trace.drive, said_of(run).limits)
    yield from (NotTested(reason) for id_, reason in trace.not_tested if id_ == "safety/renewal")


@rule("safety/hold", on=(turn, further_axes))
def hold(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that a velocity that is not renewed lasts for the hold time."""
    limits = said_of(run).limits
    if limits.hold_s is None:
        yield Note("no hold time is declared: a velocity only has to last until it is reached")
    for tries in trace.let_go:
        last = tries[-1]
        early = last.early(limits)
        if last.is_spoilt(limits):
            yield _LATE
        elif early is None and limits.hold_s is not None and not last.was_held(limits):
            late = "responses came too late to see a velocity in its hold time"
            seen_after = any(tries[-1].was_held(limits) for tries in trace.let_go)
            # The linear part is commanded after the whole velocity, and read one response later.
            yield Note(f"{late} after {last.command}") if last.by == "linear" and seen_after else NotTested(late)
        else:
            seen = early or last.turns[0]
            yield Case(
                early is None,
                seen.velocity_exchange,
                f"{last.velocity} for {limits.hold_s or 0:g} s after {last.command}",
                f"{seen.velocity} {seen.at - last.full:.2f} s after the command",
                "ended early",
            )


@rule("safety/hold-ends", on=(turn, further_axes))
def hold_ends(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the robot begins to stop at the end of the hold time."""
    limits = said_of(run).limits
    if limits.hold_s is None:
        yield Note("no hold time is declared")
        return
    for tries in trace.let_go:
        last = tries[-1]
        late = last.late(limits)
        if last.is_spoilt(limits):
            yield _LATE
            continue
        seen = late or last.turns[-1]
        yield Case(
            late is None,
            seen.velocity_exchange,
            f"a robot that begins to stop {limits.hold_s:g} s after {last.command}, at the latest after "
            f"{last.longest(limits):.2f} s",
            f"{seen.velocity} {seen.at - last.answered:.2f} s after the command",
            "holds too long",
        )


@rule("safety/watchdog", on=(turn, further_axes))
def watchdog(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the robot comes to rest whenever a velocity is not renewed."""
    for one in itertools.chain.from_iterable(trace.let_go):
        yield Case(
            one.rests(said_of(run).limits),
            one.turns[-1].velocity_exchange,
            f"rest within {trace.ends_s:.1f} s of {one.command}, {one.velocity}, which is not renewed",
            str(one.turns[-1].velocity or ""),
            "goes on",
        )


@rule("safety/cancel", on=(goal_life,))
def cancel(trace: GoalLife, run: Run) -> Iterator[Outcome]:
    """Judge that the robot stands still after its goal was cancelled."""
    for one in judged(trace):
        yield from outcomes("safety/cancel", one.drive, said_of(run).limits)


def judged(trace: GoalLife) -> tuple[Cancelled, ...]:
    """Return the cancels that are judged.

    Where a response was late, the DELETE may have been late on its way to the robot as well: another one is judged.
    """
    return tuple(one for one in trace.cancelled if not one.late) or trace.cancelled[-1:]


@rule("safety/stop-answered", on=(straight,))
def stop_answered(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge how long the responses to zero velocity take."""
    stops = [one.exchange for one in trace.drive.commands if one.velocity == STILL and not one.renewal]
    return answered_in_time(stops, run)


@rule("safety/stop-answered", on=(goal_life,))
def cancel_answered(trace: GoalLife, run: Run) -> Iterator[Outcome]:
    """Judge how long the responses to DELETE of the active goal take."""
    return answered_in_time(trace.cancels, run)


def answered_in_time(exchanges: Sequence[Exchange], run: Run) -> Iterator[Outcome]:
    """Judge that at most one response takes too long: a network may lose one request, and its sender sends it again."""
    longest_s = said_of(run).limits.settle_s + _ANSWERED_S + _USUAL * run.effort.usual_ms / 1000
    late = [one for one in exchanges if one.response.elapsed_ms / 1000 > longest_s]
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


cancel_stays = later("safety/cancel-stays")
