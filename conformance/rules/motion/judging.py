"""What the rules of motion share: where a device is, and whether it has reached a target."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.scenarios.motion import moves
from conformance.scenarios.motion.trace import SEVERAL, Command, Leg, Reading, middle_of
from conformance.scenarios.rule import Case, NotTested, Outcome
from conformance.statement.motion_map import MotionMap

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


def named(position: dict[str, float]) -> str:
    """Return a position as a noun phrase."""
    return ", ".join(f"{axis} {value:.4g}" for axis, value in position.items())
