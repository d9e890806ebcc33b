"""What the rules of motion share: where a device is, and whether it has reached a target."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from statistics import median

from conformance.scenarios.motion import moves
from conformance.scenarios.motion.trace import SEVERAL, Command, Drive, Leg, Reading, middle_of
from conformance.scenarios.rule import Case, NotTested, Outcome
from conformance.statement.motion_map import MotionMap

# A reading is late if it takes that many times as long as usual, and more than this share of the drive.
_LATE, _SHARE = 3, 0.1
# A velocity is measured over so long at least, s.
_LAPSE_S = 0.1
# And where it is seen to be renewed, s.
_RENEWED_S = 0.35
#: The scenarios in which a device moves.
ALL = (
    moves.targets, moves.clamped_targets, moves.stops, moves.new_targets, moves.many_commands, moves.repeated,
    moves.several_clients,
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
        if not abs(here[axis] - wanted) <= share * motion.tolerance(axis):
            return f"{axis} at {here[axis]:.4g} in place of {wanted:.4g}"
    return ""


def usable(leg: Leg) -> tuple[Reading, ...]:
    """Return the readings that have all positions."""
    return tuple(one for one in leg.readings if one.values)


def reached(leg: Leg, goal: Command, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device was at a target when its time was over."""
    if not goal.accepted:
        yield Case(holds=False, exchange=goal.exchange, expected=f"a 2xx for {named(goal.targets)}, within the limits")
        return
    seen = usable(leg)
    # What it shows when its time is over counts, or, where it was there before, what it showed last.
    late = tuple(one for one in seen if one.sent >= leg.due)[:SEVERAL]
    last = late if len(late) == SEVERAL else seen[-SEVERAL:]
    apart = off(at(last, motion), goal.targets, motion) if len(last) == SEVERAL else ""
    if len(last) < SEVERAL or (apart and not late):
        yield NotTested("the state could not be read when the time was over")
        return
    expected = f"{named(goal.targets)} reached {leg.due - goal.answered:.2f} s after the response ({leg.what})"
    found = f"{apart}, {last[-1].sent - goal.answered:.2f} s after the response"
    yield Case(not apart, goal.exchange, expected, observed=found)


def driven(drive: Drive, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device drove as a drive wants it."""
    if motion.velocity is None:
        return
    refused = next((one for one in drive.commands if not one.accepted), None)
    if refused is not None:
        yield Case(holds=False, exchange=refused.exchange, expected=f"a 2xx for {drive.what}")
        return
    if not drive.was_kept(motion.velocity.hold_s):
        yield NotTested("over this link the device was not driven on within its hold time")
        return
    first = drive.commands[0]
    seen = [one for one in drive.under_way if one.sent >= first.answered + motion.velocity.settle_s]
    for name, wanted in drive.wanted.items():
        found = measured(seen, name, motion)
        if found is None:
            yield NotTested("the velocity could not be measured")
            continue
        yield Case(
            abs(found - wanted) <= motion.speed_tolerance(name),
            first.exchange,
            f"{name} at {wanted:.4g} per second {motion.velocity.settle_s:g} s after the response ({drive.what})",
            observed=f"{found:.4g}",
            cause=name,
        )
        yield from _renewed(drive, name, wanted, motion)


def _renewed(drive: Drive, name: str, wanted: float, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether a velocity that was sent again and again outlasts the hold time of the first command."""
    hold_s = motion.velocity.hold_s if motion.velocity else None
    first = drive.commands[0]
    late = [one for one in drive.under_way if hold_s and one.sent >= first.answered + hold_s]
    long_enough = bool(late) and late[-1].sent - late[0].sent >= _RENEWED_S
    found = measured(late, name, motion) if wanted and long_enough else None
    if found is not None:
        yield Case(
            abs(found - wanted) <= motion.speed_tolerance(name),
            drive.commands[-1].exchange,
            f"{name} still at {wanted:.4g} per second {hold_s:g} s after the first of several commands ({drive.what})",
            observed=f"{found:.4g}",
            cause=f"{name} renewed",
        )


def measured(readings: list[Reading], name: str, motion: MotionMap) -> float | None:
    """Return a velocity by some readings, in units per second; None if they do not show it."""
    speed = motion.velocity.axes[name] if motion.velocity else None
    if speed is None or not speed.of:
        speeds = [one.speeds[name] for one in readings if one.speeds]
        return median(speeds) if len(speeds) >= SEVERAL else None
    # When a position was read of which the response came late, nobody knows.
    late_s = max(_LATE * usual_s(readings), _SHARE * (readings[-1].sent - readings[0].sent)) if readings else 0.0
    seen = [
        ((one.sent + one.received) / 2, one.values[speed.of])
        for one in readings
        if one.values and one.received - one.sent <= late_s
    ]
    if len(seen) < 2 * SEVERAL or seen[-1][0] - seen[0][0] < _LAPSE_S:
        return None
    # The median of the slopes between readings (Theil and Sen), of which no single reading decides anything.
    half_s = (seen[-1][0] - seen[0][0]) / 2
    slopes = [
        (there - here) / (later - first)
        for (first, here), (later, there) in itertools.combinations(seen, 2)
        if later - first >= half_s
    ]
    return median(slopes) / speed.scale


def usual_s(readings: Sequence[Reading]) -> float:
    """Return how long a reading takes, by the median, s."""
    return median(one.received - one.sent for one in readings) if readings else 0.0


def named(position: dict[str, float]) -> str:
    """Return a position as a noun phrase."""
    return ", ".join(f"{axis} {value:.4g}" for axis, value in position.items())


def moved_axis(leg: Leg) -> str:
    """Return the axis along which the first move goes farthest."""
    goal = leg.commands[0].targets
    return max(goal, key=lambda name: abs(goal[name] - leg.start[name]))


def stopped(leg: Leg, motion: MotionMap) -> tuple[tuple[Reading, ...], NotTested | Case | None]:
    """Return the readings from when the device must rest, or why they cannot be judged."""
    stop, order = motion.stop, leg.commands[1]
    if stop is None or not order.accepted:
        return (), Case(holds=False, exchange=order.exchange, expected="a 2xx for a stop under way")
    axis = moved_axis(leg)
    if not leg.was_under_way(axis, motion.tolerance(axis)):
        return (), NotTested("the device was not seen under way when it was stopped")
    due = order.sent + stop.rests_within_s + usual_s(leg.readings)
    readings = leg.after(due)
    return readings, None if len(readings) > 2 * SEVERAL else NotTested("the state could not be read after the stop")
