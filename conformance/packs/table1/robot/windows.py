"""Medians over several odometry samples, so that one wrong sample does not count.

A robot publishes odometry 5 to 100 times a second with noise in each sample. A client that reads faster gets one sample
several times; functions here count samples, told apart by their stamps. They judge a record and send nothing.
"""

from collections.abc import Sequence
from typing import Final

from conformance.measures import samples as measures
from conformance.measures.samples import SEVERAL
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive_trace import ALL, Turn
from conformance.packs.table1.robot.robot import Velocity, is_near

# Longest time between two odometry samples, s, if stamps do not advance.
LONGEST_SAMPLE_S: Final = 0.25
# A distance that is still this share of the first has not become shorter.
_NO_NEARER: Final = 0.8


def newest(turns: Sequence[Turn], count: int = SEVERAL) -> list[Turn]:
    """Return the last reading of each of the newest ``count`` samples that have a velocity, oldest first."""
    found: list[Turn] = []
    for turn in reversed(turns):
        if turn.velocity is None:
            continue
        if not found or _is_another(turn, found[-1]):
            if len(found) == count:
                break
            found.append(turn)
    return found[::-1]


def _is_another(turn: Turn, later: Turn) -> bool:
    if turn.odometry is not None and later.odometry is not None and turn.odometry.stamp != later.odometry.stamp:
        return True
    return later.at - turn.at > LONGEST_SAMPLE_S


def velocities(turns: Sequence[Turn]) -> list[Velocity]:
    """Return the velocities of the readings."""
    return [turn.velocity for turn in turns if turn.velocity is not None]


def middle(readings: Sequence[Velocity]) -> Velocity:
    """Return the median of each component."""
    return Velocity(*measures.middle(readings))


def part_of(velocity: Velocity, part: slice) -> Velocity:
    """Return a velocity with zeros in the components that do not count."""
    chosen = set(range(len(velocity))[part])
    return Velocity(*(value if index in chosen else 0.0 for index, value in enumerate(velocity)))


def is_stuck(turns: Sequence[Turn], wanted: Velocity, part: slice = ALL) -> bool:
    """Return whether several readings show a velocity that does not approach the wanted one."""
    seen = velocities(turns)
    if len(seen) < SEVERAL:
        return False
    return _apart(seen[-1], wanted, part) > _NO_NEARER * _apart(seen[0], wanted, part)


def _apart(one: Velocity, other: Velocity, part: slice) -> float:
    return max(abs(a - b) for a, b in zip(part_of(one, part), part_of(other, part), strict=True))


def verdict(
    limits: Limits, turns: Sequence[Turn], wanted: Velocity, factor: float = 1.0, part: slice = ALL
) -> bool | None:
    """Return whether readings show a velocity: the newest one does, or the median of the newest samples.

    Returns:
        None where the newest reading does not and there are too few samples for a median.
    """
    samples = velocities(newest(turns))
    if samples and is_near(limits, part_of(samples[-1], part), part_of(wanted, part), factor):
        return True
    return is_shown(limits, turns, wanted, factor, part)


def is_shown(
    limits: Limits,
    turns: Sequence[Turn],
    wanted: Velocity,
    factor: float = 1.0,
    part: slice = ALL,
    count: int = SEVERAL,
) -> bool | None:
    """Return whether the median of the newest samples is the velocity, within ``factor`` times the tolerance.

    Returns:
        None where there are too few samples.
    """
    samples = velocities(newest(turns, count))
    if len(samples) < count:
        return None
    return is_near(limits, part_of(middle(samples), part), part_of(wanted, part), factor, len(samples))
