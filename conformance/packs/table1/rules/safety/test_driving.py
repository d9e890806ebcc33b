"""Rules on the safety of drives: a velocity holds for its time, ends by itself, can be renewed and stopped."""

from collections.abc import Iterator

from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.goal_trace import GoalLife, GoalReached
from conformance.packs.table1.robot.standstill_trace import Standing, stays
from conformance.packs.table1.scenarios.goal_life import goal_life
from conformance.packs.table1.scenarios.goal_reached import goal_reached
from conformance.packs.table1.scenarios.standing import standing
from conformance.packs.table1.scenarios.straight import straight
from conformance.packs.table1.scenarios.trace import Driven
from conformance.packs.table1.scenarios.turn import further_axes, turn
from conformance.packs.table1.scenarios.velocity_walk import velocity_walk
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Case, Note, NotTested, Outcome, rule
from conformance.verdict.run import Run

_LATE = NotTested("responses came too late to measure how long a velocity holds")


@rule("safety/stop", on=(straight, further_axes))
def stop(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that zero velocity stops the robot before its watchdog would."""
    return outcomes("safety/stop", trace.drive, said_of(run).limits)


@rule("safety/limits-hold", on=(straight, turn, further_axes, velocity_walk))
def limits_hold(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that a robot without declared limits is no faster than commanded."""
    return outcomes("safety/limits-hold", trace.drive, said_of(run).limits)


@rule("safety/refused-keeps", on=(turn, velocity_walk))
def refused_keeps(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the robot keeps its velocity when it rejects another one."""
    return outcomes("safety/refused-keeps", trace.drive, said_of(run).limits)


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
        if last.is_void(limits) and (early is not None or last.late(limits) is not None):
            yield _LATE
        elif early is None and limits.hold_s is not None and not last.was_held(limits):
            yield NotTested("responses came too late to see a velocity in its hold time")
        else:
            seen = early or last.turns[0]
            yield Case(
                early is None,
                seen.velocity_exchange,
                f"{last.velocity} for {limits.hold_s or 0:g} s after the command",
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
        if last.is_void(limits) and (late is not None or last.early(limits) is not None):
            yield _LATE
            continue
        seen = late or last.turns[-1]
        yield Case(
            late is None,
            seen.velocity_exchange,
            f"a robot that begins to stop {limits.hold_s:g} s after the command, at the latest after "
            f"{last.longest(limits):.2f} s",
            f"{seen.velocity} {seen.at - last.answered:.2f} s after the command",
            "holds too long",
        )


@rule("safety/watchdog", on=(turn, further_axes))
def watchdog(trace: Driven, run: Run) -> Iterator[Outcome]:
    """Judge that the robot comes to rest when a velocity is not renewed."""
    for tries in trace.let_go:
        last = tries[-1]
        yield Case(
            last.rests(said_of(run).limits),
            last.turns[-1].velocity_exchange,
            f"rest within {trace.ends_s:.1f} s of a command that is not renewed",
            str(last.turns[-1].velocity or ""),
            "goes on",
        )


@rule("safety/cancel", on=(goal_life,))
def cancel(trace: GoalLife, run: Run) -> Iterator[Outcome]:
    """Judge that the robot stands still after its goal was cancelled."""
    for one in trace.cancelled:
        yield from outcomes("safety/cancel", one.drive, said_of(run).limits)


@rule("safety/watchdog", on=(goal_reached,))
def not_taken_up(trace: GoalReached, run: Run) -> Iterator[Outcome]:
    """Judge that the robot does not resume an old velocity when it has reached a goal."""
    if trace.turned is not None:
        yield from outcomes("safety/watchdog", trace.turned, said_of(run).limits)


@rule("safety/cancel-stays", on=(standing,))
def cancel_stays(trace: tuple[Standing, ...]) -> Iterator[Outcome]:
    """Judge that neither motion nor a goal comes back after a goal was cancelled."""
    return stays(trace, "safety/cancel-stays")
