"""Shared functions of the motion rules: where a device is, and whether it has reached a target."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from statistics import median

from conformance.measures.samples import SEVERAL, longest_s, usual_s
from conformance.scenarios.motion import moves, several
from conformance.scenarios.motion.measuring import end_of_travel, speed_in
from conformance.scenarios.motion.trace import Command, Drive, Leg, Reading, middle_of
from conformance.scenarios.rule import NotTested, Outcome
from conformance.statement.motion_map import MotionMap
from conformance.verdict.evidence import Case

# Time over which a velocity is seen to be renewed, s.
_RENEWED_S = 0.35
# Share of a renewed velocity to which it must not fall in between.
_LULL = 0.5
# Time after the device must rest in which a stop must be answered, s.
_TOO_LATE_S = 1.0
# Multiple of the tolerance by which a device that was stopped rests short of its target.
_SHORT = 4.0
#: The scenarios in which a device moves.
ALL = (
    moves.targets, moves.clamped_targets, moves.stops, moves.new_targets, moves.many_commands, moves.repeated,
    several.several_clients,
)  # fmt: skip


def legs_of(trace: Leg | tuple[Leg, ...]) -> tuple[Leg, ...]:
    """Return the legs of a trace."""
    return (trace,) if isinstance(trace, Leg) else trace


def at(readings: tuple[Reading, ...], motion: MotionMap) -> dict[str, float]:
    """Return where the device is by the median of some readings."""
    return {axis: middle_of(readings, axis) for axis in motion.state.axes}


def off(here: dict[str, float], there: dict[str, float], motion: MotionMap, share: float = 1.0) -> str:
    """Return by how much and along which axis a position is off another; empty if it is within the tolerances."""
    for axis, wanted in there.items():
        # So that a position that is no number is off as well.
        if not abs(motion.state.axes[axis].apart(here[axis], wanted)) <= share * motion.tolerance(axis):
            return f"{axis} at {here[axis]:.4g} in place of {wanted:.4g}"
    return ""


def usable(leg: Leg) -> tuple[Reading, ...]:
    """Return the readings that have all positions."""
    return tuple(reading for reading in leg.readings if reading.values)


def judge_goal(leg: Leg, goal: Command, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device was at a target when its time was over."""
    if not goal.is_ok:
        yield Case(
            holds=False, exchange=goal.exchange, expected=f"a 2xx for {in_words(goal.targets)}, within the limits"
        )
        return
    seen = usable(leg)
    # The readings at the end of its time count; if it arrived earlier, the last readings.
    late = tuple(reading for reading in seen if reading.sent >= leg.due)[:SEVERAL]
    last = late if len(late) == SEVERAL else seen[-SEVERAL:]
    apart = off(at(last, motion), goal.targets, motion) if len(last) == SEVERAL else ""
    if len(last) < SEVERAL or (apart and not late):
        yield NotTested("the state could not be read when the time was over")
        return
    expected = f"{in_words(goal.targets)} reached {leg.due - goal.answered:.2f} s after the response ({leg.what})"
    found = f"{apart}, {last[-1].sent - goal.answered:.2f} s after the response"
    yield Case(not apart, goal.exchange, expected, observed=found)


def tries_of(drives: Sequence[Drive]) -> Iterable[list[Drive]]:
    """Return all tries of each drive: a drive that a slow link spoilt is repeated later."""
    found: dict[str, list[Drive]] = {}
    for drive in drives:
        found.setdefault(drive.what, []).append(drive)
    return found.values()


def follows(drives: tuple[Drive, ...], motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device drove as commanded; a drive that a slow link broke off is repeated."""
    seen = [reading for drive in drives for reading in (*drive.under_way, *drive.after)]
    for tries in tries_of(drives):
        # Each refused move counts.
        shown = [
            one
            for one in tries
            if motion.velocity is not None
            and (one.was_kept(motion.velocity.hold_s) or not all(command.is_ok for command in one.commands))
        ]
        found = [outcome for one in shown for outcome in _judge_drive(one, motion, seen)]
        cases = [case for case in found if isinstance(case, Case)]
        yield from cases or found
        if not shown:
            yield NotTested("over this link the device was not driven on within its hold time")


def _judge_drive(drive: Drive, motion: MotionMap, so_far: Sequence[Reading]) -> Iterator[Outcome]:
    if motion.velocity is None:
        return
    refused = next((command for command in drive.commands if not command.is_ok), None)
    if refused is not None:
        yield Case(holds=False, exchange=refused.exchange, expected=f"a 2xx for {drive.name}")
        return
    first = drive.commands[0]
    seen = [reading for reading in drive.under_way if reading.sent >= drive.settled_at(motion.velocity.settle_s)]
    for name, wanted in drive.wanted.items():
        if (place := end_of_travel(drive.under_way, name, wanted, motion, so_far)) is not None:
            yield NotTested(f"it stands at {place:.4g}, maybe the end of its travel: write its limits into the map")
            continue
        found = speed_in(seen, name, motion)
        if found is None:
            yield NotTested("the velocity could not be measured")
            continue
        yield Case(
            abs(found - wanted) <= motion.speed_tolerance(name),
            first.exchange,
            f"{name} at {wanted:.4g} per second {motion.velocity.settle_s:g} s after the response ({drive.name})",
            observed=f"{found:.4g}",
            cause=name,
        )
        yield from judge_renewed(drive, name, wanted, motion)


def judge_renewed(drive: Drive, name: str, wanted: float, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a velocity that was sent again and again outlasts the hold time of the first command."""
    hold_s, settle_s = (motion.velocity.hold_s, motion.velocity.settle_s) if motion.velocity else (None, 0.0)
    # A device may need longer to reach a velocity than it holds one.
    begun = max(drive.commands[0].answered + (hold_s or 0.0), drive.settled_at(settle_s))
    late = [reading for reading in drive.under_way if hold_s and reading.sent >= begun]
    long_enough = bool(late) and late[-1].sent - late[0].sent >= _RENEWED_S
    found = speed_in(late, name, motion) if wanted and long_enough else None
    if found is not None:
        slow = slowest(late, name, wanted)
        if slow is not None and slow < _LULL * abs(wanted) and abs(wanted) > 2 * motion.speed_tolerance(name):
            found = math.copysign(1, wanted) * slow
        yield Case(
            abs(found - wanted) <= motion.speed_tolerance(name),
            drive.commands[-1].exchange,
            f"{name} still at {wanted:.4g} per second {hold_s:g} s after the first of several commands ({drive.name})",
            observed=f"{found:.4g}",
            cause=f"{name} renewed",
        )


def slowest(readings: Sequence[Reading], name: str, wanted: float) -> float | None:
    """Return the least of the medians of several readings in a row, in the direction that is wanted."""
    seen = [math.copysign(1, wanted) * reading.speeds[name] for reading in readings if name in reading.speeds]
    return min((median(seen[index : index + SEVERAL]) for index in range(len(seen) - SEVERAL + 1)), default=None)


def in_words(position: dict[str, float]) -> str:
    """Return a position as a noun phrase."""
    return ", ".join(f"{axis} {value:.4g}" for axis, value in position.items())


def moved_axis(leg: Leg) -> str:
    """Return the axis along which the first move goes farthest."""
    goal = leg.commands[0].targets
    return max(goal, key=lambda name: abs(goal[name] - leg.start[name]))


def halts(
    legs: tuple[Leg, ...], motion: MotionMap
) -> Iterator[tuple[Leg, tuple[Reading, ...], NotTested | Case | None]]:
    """Yield legs with a stop, the readings from when the device must rest, or why they cannot be judged.

    Of several tries of one stop, those that show nothing are left out if another one shows something.
    """
    for _, group in itertools.groupby(legs, key=lambda leg: leg.what):
        tries = list(group)
        # A link holds back one response, and not each of several.
        excused = not is_each_late([(leg.commands[1], leg.readings) for leg in tries])
        found = [(leg, *_at_rest(leg, motion, excused=excused)) for leg in tries]
        usable = [one for one in found if not isinstance(one[2], NotTested)]
        yield from usable or found[-1:]


def is_each_late(tries: Sequence[tuple[Command, Sequence[Reading]]]) -> bool:
    """Return whether a command was tried as often as allowed, and its response was late each time."""
    return len(tries) == moves.TRIES and all(command.was_late(readings) for command, readings in tries)


def must_rest_from(command: Command, readings: Sequence[Reading], *, excused: bool) -> float:
    """Return from when on the time counts in which a device must rest, s.

    Args:
        command: the stop, or velocity 0.
        readings: around it.
        excused: whether the link may be why its response was late; then the device may have got it late as well.
    """
    return command.answered if excused and command.was_late(readings) else command.sent + longest_s(readings)


def went_on(
    command: Command, readings: Sequence[Reading], speeds: dict[str, float], within_s: float, motion: MotionMap
) -> str:
    """Return evidence that a device did not rest in time before a late response; empty if there is none.

    Nobody reads the state before the response to a stop; the next reading shows where the device is then. And a client
    that waits for a response much longer than for the rest cannot know that the device rests.

    Args:
        command: the stop, or velocity 0.
        readings: around it.
        speeds: at most, by axis, before it.
        within_s: time in which the device must rest, s.
        motion: the map.
    """
    before = [reading for reading in readings if reading.values and reading.received <= command.sent]
    after = [reading for reading in readings if reading.values and reading.sent >= command.answered]
    if not before or len(after) < SEVERAL:
        return ""
    took_s = command.answered - command.sent
    if took_s > within_s + usual_s(readings) + _TOO_LATE_S:
        return f"no response for {took_s:.2f} s, {moves.TRIES} times"
    blind_s = command.sent - before[-1].sent + 2 * usual_s(readings) + within_s
    for axis, speed in speeds.items():
        way = abs(middle_of(after[:SEVERAL], axis) - before[-1].values[axis])
        if way > abs(speed) * blind_s + 2 * motion.tolerance(axis):
            return f"{axis} {way:.3g} farther when the response came, {took_s:.2f} s later"
    return ""


def _at_rest(leg: Leg, motion: MotionMap, *, excused: bool) -> tuple[tuple[Reading, ...], NotTested | Case | None]:
    (goal, order), axis = leg.commands[:2], moved_axis(leg)
    rests_s = motion.stop.rests_within_s if motion.stop else 0.0
    began = must_rest_from(order, leg.readings, excused=excused)
    readings = leg.after(began + rests_s)
    is_under_way = leg.was_under_way(axis, motion.tolerance(axis), order.answered if excused else began)
    if not is_under_way and len(readings) > 2 * SEVERAL and readings[-1].sent >= leg.due - motion.state.fresh_s:
        # For as long as it would have needed, it rests short of its target; one that refuses a stop never set out.
        first, last = at(readings[:SEVERAL], motion), at(readings[-SEVERAL:], motion)
        is_under_way = order.is_ok and bool(off(last, goal.targets, motion, _SHORT)) and not off(last, first, motion)
    if not is_under_way:
        way = abs(goal.targets[axis] - leg.start[axis])
        return (), NotTested(
            f"a move of {axis} by {way:.3g} was over before the stop came, {order.answered - goal.sent:.2f} s after it "
            f"began. Give {axis} wider limits in the map, or a lower speed, so that a move takes about a second"
        )
    if not order.is_ok:
        return (), Case(holds=False, exchange=order.exchange, expected="a 2xx for a stop under way")
    if not excused:
        moved = went_on(order, leg.readings, _fastest_so_far(leg), rests_s, motion)
        if moved:
            expected = f"rest {rests_s:g} s after {leg.what}"
            return (), Case(False, order.exchange, expected, observed=moved, cause="held back")
    return readings, None if len(readings) > 2 * SEVERAL else NotTested("the state could not be read after the stop")


def _fastest_so_far(leg: Leg) -> dict[str, float]:
    """Return how fast the device can be while moving: at most twice its average speed."""
    goal, order = leg.commands[:2]
    seen = [reading for reading in usable(leg) if goal.answered < reading.sent and reading.received <= order.sent]
    if not seen:
        return {}
    axis, last = moved_axis(leg), seen[-1]
    return {axis: 2 * abs(last.values[axis] - leg.start[axis]) / (last.received - goal.answered)}
