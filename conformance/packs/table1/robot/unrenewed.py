"""Choose the velocities that are not renewed, and how each is commanded last."""

import math
import random
from typing import Final

from conformance.packs.table1.robot.abilities import ABOUT, AHEAD
from conformance.packs.table1.robot.motion_map import By
from conformance.packs.table1.robot.robot import Robot, Velocity

# _SLOW: slow velocity, as a share of its limit. _TOLD: as a multiple of what may pass for rest. Below: at most this
# share.
_SLOW: Final = 0.1
_TOLD: Final = 4
_MOST: Final = 0.6


def unrenewed(
    bent: Velocity, ahead: Velocity, across: Velocity, others: tuple[Velocity, ...], effort: str, seed: int
) -> list[tuple[Velocity, By]]:
    """Return velocities to send without renewal, and how each is commanded last.

    A robot may keep a watchdog for each path, for each sign, for each part, and for small or large velocities. At the
    effort "quick" the seed says which one is tried.

    Args:
        bent: a velocity along an arc.
        ahead: its opposite, or as much of it as the robot can drive.
        across: the same to the other side.
        others: velocities of another size or with one part alone; the first one's connection is closed.
        effort: quick, standard or deep.
        seed: of the run.
    """
    ways: list[tuple[Velocity, By]] = [
        (bent, "linear" if bent.linear_x else "velocity"),
        (bent, "velocity"),
        (ahead, "linear" if ahead.linear_x else "velocity"),
        *((one, "velocity" if number else "closing") for number, one in enumerate(others)),
        (across, "velocity"),
        (ahead, "xml"),
    ]
    if effort == "deep" or not any(velocity.linear_x * ahead.linear_x > 0 for velocity in others):
        ways.append((ahead, "velocity"))
    ways = [way for way in dict.fromkeys(ways) if any(way[0])]
    if effort == "quick":
        return random.Random(f"{seed}/ways").sample(ways, min(1, len(ways)))  # noqa: S311 - no secret
    return ways


def slow(robot: Robot, seed: int) -> list[Velocity]:
    """Return a slow drive and a slow turn that differ from rest, in directions that the seed chooses."""
    limits, chance = robot.limits, random.Random(f"{seed}/slow")  # noqa: S311 - no secret
    found: list[Velocity] = []
    for component in (AHEAD, ABOUT):
        end = chance.choice([number for number in limits.range_of(component) if number] or [0.0])
        size = min(max(_SLOW * abs(end), _TOLD * limits.rest(component)), _MOST * abs(end))
        found.append(robot.only(component, math.copysign(size, end)))
    return found
