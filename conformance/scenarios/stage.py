"""The stages of a run, in their order: what each needs the device to be like, and how it leaves it."""

from enum import StrEnum
from typing import Final


class Stage(StrEnum):
    """When in a run the turn of a scenario or a check comes.

    Reading comes first. Then the longest drive, other drives, and the attempts that must leave the device at rest,
    which one watch covers; meanwhile the device is read at rest. Requests whose effects come late are sent late, and
    other checks run while the suite waits for more of these effects.
    """

    REACH = "reach"
    READING = "reading"
    DRIVE = "drive"
    MOTION = "motion"
    STANDSTILL = "standstill"
    RESTING = "resting"
    STAYS = "stays"
    INPUT = "input"
    ACTING = "acting"
    SILENCE = "silence"
    EFFECT = "effect"
    ARRIVAL = "arrival"
    DESCRIBE = "describe"
    ASIDE = "aside"
    LATE = "late"
    ATTACK = "attack"
    LAST = "last"


STAGES: Final = tuple(Stage)


class Leaves(StrEnum):
    """How a scenario leaves the device."""

    UNTOUCHED = "untouched"  # it was only read
    AT_REST = "at rest"
    MOVING = "moving"  # or about to move: whatever needs rest has to stop it first


class Need(StrEnum):
    """What a scenario needs."""

    REST = "rest"
    PUBLISHERS = "publishers"
    SUBSCRIBERS = "subscribers"
    MOTION = "motion"  # permission to move the device, which is at rest when the scenario begins
