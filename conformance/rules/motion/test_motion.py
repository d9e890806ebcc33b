"""Whether a device moves as its motion map says (statement, tables ``[motion.*]``)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from conformance.measures.samples import SEVERAL
from conformance.rules.motion.judging import ALL, at, halts, in_words, judge_goal, legs_of, moved_axis, off, usable
from conformance.rules.motion.test_velocities import judge_ends
from conformance.scenarios.motion.measuring import speed_in
from conformance.scenarios.motion.moves import many_commands, new_targets, repeated, stops, targets
from conformance.scenarios.motion.resting import crept, fastest, set_out
from conformance.scenarios.motion.several import several_clients, several_drivers
from conformance.scenarios.motion.trace import Command, Drive, Leg, Reading, middle_of
from conformance.scenarios.motion.velocities import velocities
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.statement.motion_map import MotionMap
from conformance.verdict.evidence import Case

# Time between two readings that shows a speed, s.
_APART_S = 0.15
# Duration of a drive that shows which axis moves, s.
_TOLD_S = 0.3
# Multiple of the declared speed that counts as faster: it cannot be measured more exactly from outside.
_FASTER = 1.1
# A device that moves up to this long after it must rest has stopped too late; later, it has started again, s.
_SOON_S = 0.5
# Share of the time that the rest of a way takes by the speed so far.
_SURELY = 0.7
_NO_STOP = NotClaimed("the map declares no stop")


@rule("motion/reaches", on=(targets,))
def reaches(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether each target within the limits is reached in time."""
    for leg in trace:
        yield from judge_goal(leg, leg.commands[-1], motion)


@rule("motion/stays", on=(targets, new_targets))
def stays(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device stays at a target that it has reached, the last one that it accepted."""
    for leg in trace:
        goal = next((command for command in reversed(leg.commands) if command.is_ok), leg.commands[-1])
        seen = leg.after(goal.answered)
        arrived = _first_at(seen, goal.targets, motion)
        if arrived is None:
            continue
        last = seen[-SEVERAL:]
        apart = off(at(last, motion), goal.targets, motion, 1.5)
        yield Case(not apart, goal.exchange, f"{in_words(goal.targets)} kept", observed=f"{apart} after it was reached")


def _first_at(readings: tuple[Reading, ...], goal: dict[str, float], motion: MotionMap) -> int | None:
    """Return the index of the first of several readings in a row at a position."""
    for index in range(len(readings) - SEVERAL + 1):
        if not any(off(reading.values, goal, motion) for reading in readings[index : index + SEVERAL]):
            return index
    return None


@rule("motion/way", on=ALL)
def way(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device stays within its limits in all moves. A start beyond the limits does not count."""
    for leg in legs_of(trace):
        seen = usable(leg)
        for name, axis in motion.state.axes.items():
            if axis.angle or not axis.bound:
                continue
            room = motion.tolerance(name)
            least, greatest = axis.ends[0] - room, axis.ends[1] + room
            places = [middle_of(seen[i : i + SEVERAL], name) for i in range(len(seen) - SEVERAL + 1)]
            inside = next((i for i, one in enumerate(places) if least <= one <= greatest), len(places))
            beyond = [place for place in places[inside:] if not least <= place <= greatest]
            if places:
                found = f"{name} {max(beyond, key=abs):.4g}" if beyond else ""
                yield Case(
                    not beyond,
                    leg.commands[-1].exchange,
                    f"{name} between {axis.ends[0]:g} and {axis.ends[1]:g} all the time ({leg.what})",
                    observed=found,
                    cause=name,
                )


@rule("motion/speed", on=ALL)
def speed(trace: Leg | tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether an axis moves no faster than declared."""
    limited = {name: axis.speed for name, axis in motion.state.axes.items() if axis.speed is not None}
    if not limited:
        yield NotClaimed("the map declares no greatest speed")
    for leg, (name, most) in itertools.product(legs_of(trace), limited.items()):
        seen = usable(leg)
        highest = 0.0
        for index, one in enumerate(seen):
            later = next((two for two in seen[index:] if two.sent - one.received > _APART_S), None)
            if later is not None:
                moved = motion.state.axes[name].distance(later.values[name], one.values[name]) - motion.tolerance(name)
                highest = max(highest, moved / (later.received - one.sent))
        yield Case(
            highest <= _FASTER * most,
            leg.commands[-1].exchange,
            f"{name} at {most:g} {motion.state.axes[name].unit or 'units'}/s at most ({leg.what})",
            observed=f"{highest:.3g} {motion.state.axes[name].unit or 'units'}/s",
            cause=name,
        )


@rule("motion/stop", on=(stops, velocities))
def stop_rests(trace: tuple[Leg, ...] | tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a stop under way stops the device in time, before its target."""
    if motion.stop is None:
        yield _NO_STOP
    else:
        drives = [drive for drive in trace if isinstance(drive, Drive)]
        yield from judge_ends(drives, motion.stop.rests_within_s, "the stop", motion)
    for leg, readings, unusable in halts(tuple(leg for leg in trace if isinstance(leg, Leg)), motion):
        if unusable is not None:
            yield unusable
            continue
        goal, order = leg.commands[:2]
        where, (moved, seen) = at(readings[:SEVERAL], motion), _soon(readings, motion)
        arrived = not off(where, goal.targets, motion)
        rests_s = motion.stop.rests_within_s if motion.stop else 0.0
        yield Case(
            not moved and not arrived,
            order.exchange,
            f"rest {rests_s:g} s after {leg.what}, before the target",
            observed=f"{moved}, {seen.sent - order.sent:.2f} s after the stop"
            if moved
            else f"the target reached all the same: {in_words(where)}",
            cause="moves" if moved else "arrived",
        )


def _soon(readings: tuple[Reading, ...], motion: MotionMap) -> tuple[str, Reading]:
    """Return the axes that still move when the device must rest, as text, and the last reading that counts."""
    soon = tuple(reading for reading in readings if reading.sent < readings[0].sent + _SOON_S)
    moved = off(at(soon[-SEVERAL:], motion), at(readings[:SEVERAL], motion), motion) or fastest(soon, motion)
    return moved, soon[-1]


@rule("motion/stop-lasts", on=(stops,))
def stop_lasts(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that was stopped stays where it is, and does not resume its way."""
    if motion.stop is None:
        yield _NO_STOP
    for leg, readings, unusable in halts(trace, motion):
        if unusable is None:
            if _soon(readings, motion)[0]:
                yield NotTested("the device did not come to rest in time: motion/stop")
                continue
            where, last = at(readings[:SEVERAL], motion), at(readings[-SEVERAL:], motion)
            moved = off(last, where, motion) or fastest(readings, motion) or crept(readings, motion, leg.resting)
            moved = moved or set_out(readings, motion, leg.resting)
            after = readings[-1].sent - leg.commands[1].sent
            yield Case(
                not moved, leg.commands[1].exchange, f"rest after {leg.what}", f"{moved}, {after:.1f} s after the stop"
            )


@rule("motion/new-target", on=(new_targets,))
def new_target(trace: tuple[Leg, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge a second target during a move: it displaces the first for good or is refused, as declared."""
    declared = motion.goto.while_moving if motion.goto else None
    for _, tries in itertools.groupby(trace, key=lambda leg: leg.what):
        # Of several tries of one move, those that show nothing are left out if another one shows something.
        found = [list(_judge_second(leg, declared, motion)) for leg in tries]
        shown = [outcomes for outcomes in found if any(isinstance(one, Case) for one in outcomes)]
        yield from itertools.chain.from_iterable(shown or found[-1:])


def _judge_second(leg: Leg, declared: str | None, motion: MotionMap) -> Iterator[Outcome]:
    first, second = leg.commands[:2]
    if declared is None and second.is_refused:
        yield from judge_goal(leg, first, motion)
    elif declared != "refused":
        yield from _judge_last(leg, second, motion)
        yield from _given_up(leg, motion) if declared else ()
    elif second.is_refused or _arrives_at(leg, motion) > second.answered:
        yield Case(second.is_refused, second.exchange, "4xx for a second move under way")
        if second.is_refused:
            yield from judge_goal(leg, first, motion)
    else:
        yield NotTested("the device may have arrived before it got the second move")


def _arrives_at(leg: Leg, motion: MotionMap) -> float:
    """Return when the device arrives at the first target at the earliest, by its speed before the second move."""
    first, second = leg.commands[:2]
    seen = [reading for reading in usable(leg) if reading.received <= second.sent]
    axis = moved_axis(leg)
    way = [abs(reading.values[axis] - leg.start[axis]) for reading in seen]
    moved = [index for index, one in enumerate(way) if one > motion.tolerance(axis)]
    if not moved or way[-1] == 0:
        return 0.0
    since_s = seen[-1].received - first.sent
    left = abs(first.targets[axis] - seen[-1].values[axis]) - motion.tolerance(axis)
    return seen[-1].sent + _SURELY * left / way[-1] * since_s


def _given_up(leg: Leg, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a device that has another target gives up the first one within the time to settle."""
    first, second = leg.commands[:2]
    settle_s = motion.goto.settle_s if motion.goto else 0.0
    readings = leg.after(second.answered + settle_s)
    if not second.is_ok or len(readings) < SEVERAL:
        return
    axis = moved_axis(leg)
    ahead = 1 if first.targets[axis] > leg.start[axis] else -1
    places = [ahead * reading.values[axis] for reading in readings]
    farther = max(places) - places[0]
    yield Case(
        farther <= 2 * motion.tolerance(axis),
        second.exchange,
        f"{axis} no nearer to the first target {settle_s:g} s after a second one was accepted",
        observed=f"{farther:.3g} nearer after that",
        cause="first target",
    )


@rule("motion/last-of-many", on=(many_commands,))
def last_of_many(trace: Leg, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device ends at the last accepted of many targets."""
    accepted = [command for command in trace.commands if command.is_ok]
    yield from _judge_last(trace, (accepted or list(trace.commands))[-1], motion)


def _judge_last(leg: Leg, goal: Command, motion: MotionMap) -> Iterator[Outcome]:
    """Judge the target of the last of several moves. Another target proves nothing if the map has no `while_moving`."""
    last = usable(leg)[-SEVERAL:]
    others = [one for one in leg.commands if one.is_ok and last and not off(at(last, motion), one.targets, motion)]
    for outcome in judge_goal(leg, goal, motion):
        if not others or (motion.goto and motion.goto.while_moving) or not isinstance(outcome, Case) or outcome.holds:
            yield outcome
        else:
            yield NotTested(
                f"it rests at {in_words(others[0].targets)}, the target of another accepted move. A device that makes "
                'its moves side by side may do so: write while_moving = "displaces" into the map if the last one counts'
            )


@rule("motion/repeated", on=(repeated,))
def repetition(trace: Leg, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a move that is sent twice ends where it ends when it is sent once."""
    yield from last_of_many.judge(trace, motion)


@rule("motion/one-client", on=(several_clients, several_drivers))
def one_client(trace: tuple[Leg, ...] | tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether of several clients' targets or velocities one is taken, and no mix of two."""
    for leg in trace:
        if isinstance(leg, Drive):
            yield from _of_one_driver(leg, motion)
            continue
        accepted = [command for command in leg.commands if command.is_ok]
        seen = usable(leg)[-SEVERAL:]
        if not accepted or len(seen) < SEVERAL:
            yield NotTested("no client's move was accepted" if not accepted else "the state could not be read")
            continue
        here = at(seen, motion)
        fits = any(not off(here, command.targets, motion) for command in accepted)
        yield Case(fits, accepted[-1].exchange, "the target of one client", observed=in_words(here))


def _of_one_driver(drive: Drive, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device follows one of several clients' commands, not a mixture."""
    accepted = [command for command in drive.commands if command.is_ok]
    if motion.velocity is None or not accepted:
        return
    if drive.at_end:
        yield NotTested("it stands where its travel seems to end: write its limits into the map")
        return
    begin, end = drive.settled_at(motion.velocity.settle_s), accepted[-1].sent + (motion.velocity.hold_s or math.inf)
    seen = [reading for reading in drive.under_way if begin <= reading.sent and reading.received <= end]
    found = {name: speed_in(seen, name, motion) for name in motion.velocity.axes}
    lasted_s = seen[-1].sent - seen[0].sent if seen else 0.0
    # Their noise moves a short one, by positions a velocity is seen in a while only.
    brief = {name for name, axis in motion.velocity.axes.items() if axis.of and lasted_s < _TOLD_S}
    speeds = {name: speed for name, speed in found.items() if speed is not None and name not in brief}
    if len(speeds) < len(found):
        # The hold time is too short for it, or the link too slow: positions tell enough of most devices.
        return
    fastest_of = {name: max(abs(command.targets[name]) for command in drive.commands) for name in speeds}
    fits = any(
        # Nearer to its own velocity, or to rest, than to another client's. An axis that no client drives shows nothing.
        all(abs(speeds[name] - command.targets[name]) < most / 2 for name, most in fastest_of.items() if most)
        for command in accepted
    )
    yield Case(fits, accepted[-1].exchange, "the velocity of one client", observed=in_words(speeds), cause="velocity")
