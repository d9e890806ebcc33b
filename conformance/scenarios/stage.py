"""Stages of a run in their order, and the states that scenarios need and leave."""

from enum import StrEnum
from typing import Final


class Stage(StrEnum):
    """The stage of a run in which a scenario or check runs.

    Reading comes first. Then come the longest drive, other drives, more reading while the device settles, and the
    attempts that must leave the device at rest, which share one observation. Requests with late effects are sent late,
    and other checks run while the suite waits for further effects.
    """

    REACH = "reach"
    READING = "reading"
    DRIVE = "drive"
    MOTION = "motion"
    SETTLING = "settling"
    STANDSTILL = "standstill"
    RESTING = "resting"
    INPUT = "input"
    ACTING = "acting"
    EFFECT = "effect"
    ARRIVAL = "arrival"
    DESCRIBE = "describe"
    ASIDE = "aside"
    LATE = "late"
    ATTACK = "attack"
    LAST = "last"


STAGES: Final = tuple(Stage)


class Leaves(StrEnum):
    """The state in which a scenario leaves the device."""

    UNTOUCHED = "untouched"  # the scenario only read it
    AT_REST = "at rest"
    MOVING = "moving"  # the device moves or is about to: a scenario that needs rest has to stop it first


class Need(StrEnum):
    """A thing that a scenario needs before it can be played."""

    REST = "rest"
    PUBLISHERS = "publishers"
    SUBSCRIBERS = "subscribers"
    MOTION = "motion"  # permission to move the device, which is at rest when the scenario begins
