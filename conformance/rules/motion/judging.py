"""What the rules of motion share: where a device is, and whether it has reached a target."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.scenarios.motion import plays
from conformance.scenarios.motion.trace import SEVERAL, Command, Leg, Reading, place
from conformance.scenarios.rule import Case, NotTested, Outcome
from conformance.statement.motion_map import MotionMap

#: The scenarios in which a device moves.
ALL = (
    plays.targets, plays.clamped_targets, plays.stops, plays.new_targets, plays.many_commands, plays.repeated,
    plays.several_clients,
)  # fmt: skip


def legs_of(trace: Leg | tuple[Leg, ...]) -> tuple[Leg, ...]:
    """Return the legs of a trace."""
    return (trace,) if isinstance(trace, Leg) else trace


def at(readings: tuple[Reading, ...], motion: MotionMap) -> dict[str, float]:
    """Return where the device is by the median of some readings."""
    return {axis: place(readings, axis) for axis in motion.state.axes} if readings else {}


def off(here: dict[str, float], there: dict[str, float], motion: MotionMap, share: float = 1.0) -> str:
    """Return by how much and along which axis a position is off another; empty if it is within the tolerances."""
    for axis, wanted in there.items():
        if abs(here[axis] - wanted) > share * motion.tolerance(axis):
            return f"{axis} {here[axis]:.4g} in place of {wanted:.4g}"
    return ""


def usable(leg: Leg) -> tuple[Reading, ...]:
    """Return the readings that have all positions."""
    return tuple(one for one in leg.readings if one.values)


def reached(leg: Leg, goal: Command, motion: MotionMap) -> Iterator[Outcome]:
    """Judge whether the device was at a target when its time was over."""
    expected = f"{leg.what}: {named(goal.targets)} reached in time"
    if not goal.accepted:
        yield Case(holds=False, exchange=goal.attempt, expected=f"a 2xx for {named(goal.targets)}, within the limits")
        return
    seen = usable(leg)
    last = seen[-SEVERAL:]
    if len(last) < SEVERAL:
        yield NotTested("the state could not be read")
        return
    # What the device shows when its time is over counts, or, where it was there before, what it showed last.
    late = tuple(one for one in seen if one.sent >= leg.due)[:SEVERAL]
    last = late if len(late) == SEVERAL else last
    apart = off(at(last, motion), goal.targets, motion)
    found = f"{apart}, {last[-1].sent - goal.answered:.2f} s after the response"
    yield Case(not apart, goal.attempt, expected, observed=found)


def named(position: dict[str, float]) -> str:
    """Return a position as a noun phrase."""
    return ", ".join(f"{axis} {value:.4g}" for axis, value in position.items())
