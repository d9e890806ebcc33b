"""What was done with goals, and what the robot showed, as values that can be judged without a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from conformance.packs.table1.robot.drive_trace import Trace
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.plan import Start
from conformance.transport.exchange import Exchange


@dataclass(frozen=True)
class NoGoal:
    """A robot without a goal: it is read, and cancelled all the same.

    Attributes:
        read, cancelled: the responses.
    """

    read: Exchange
    cancelled: Exchange


@dataclass(frozen=True)
class Put:
    """A goal that was put, and what the robot then showed.

    Attributes:
        exchange: of the PUT.
        body: the goal.
        shown: the goal that the robot showed; None: it showed none.
        read: of the GET that showed it.
        differs: in what it differs from the one that was put; empty: in nothing.
        ended: whether the goal may have ended before it could be read, as the robot was there.
    """

    exchange: Exchange
    body: dict[str, Any]
    shown: Any
    read: Exchange
    differs: str
    ended: bool


@dataclass(frozen=True)
class Cancelled:
    """A goal that was cancelled.

    Attributes:
        exchange: of the DELETE.
        read: of the last GET.
        gone: whether the robot had no goal in the end.
        drive: the wait for rest.
    """

    exchange: Exchange
    read: Exchange
    gone: bool
    drive: Trace


@dataclass(frozen=True)
class GoalLife:
    """The trace of the scenario goal_life: a goal is put, repeated, contradicted, replaced by another, and cancelled.

    Attributes:
        none: readings and DELETEs before the first goal was put.
        first: the PUT of the first goal, which has all optional members.
        stamps: the first goal's stamp in two readings.
        repeated: the PUTs of the active goal again.
        contradicted: the PUTs of another pose under the active goal's id.
        velocity: the response to a velocity that was sent while a goal was active; None: no velocity was sent.
        drive: commands and readings of that velocity, where the robot accepted it.
        second: the PUT of another goal without an id.
        renamed: whether the second goal is accepted when it has an id; None: it was accepted without an id.
        cancelled: the DELETEs of the active goal; empty: the goal had ended before.
    """

    none: tuple[NoGoal, ...] = ()
    first: Put | None = None
    stamps: tuple[Any, ...] = ()
    repeated: tuple[Put, ...] = ()
    contradicted: tuple[Put, ...] = ()
    velocity: Exchange | None = None
    drive: Trace | None = None
    second: Put | None = None
    renamed: bool | None = None
    cancelled: tuple[Cancelled, ...] = ()


@dataclass(frozen=True)
class GoalReached:
    """A goal that the robot drove to, or did not.

    Attributes:
        put: of the PUT.
        there: the goal, in the frame of goals.
        here: where the robot was in the end.
        way_m: how far the robot came from where it was at first, m; has_to_m: how far it has to come at least.
        left_m: how far it still is from the goal, m; reached_m: how near it has to come.
        drive: all that was read on the way.
        read: the last GET of the goal.
        ended: whether there was no goal any more.
        undecided: whether the robot was still on its way when the time was over.
        turned: the drive behind it, which shows whether a velocity from before the goal is taken up again; or None.
        start: where a plan begins behind it; or None.
        again: of the PUT of the same goal, once it had ended; or None.
    """

    put: Exchange
    there: Pose | None = None
    here: Pose | None = None
    way_m: float = 0.0
    has_to_m: float = 0.0
    left_m: float = 0.0
    reached_m: float = 0.0
    drive: Trace | None = None
    read: Exchange | None = None
    ended: bool = False
    undecided: bool = False
    turned: Trace | None = None
    start: Start | None = None
    again: Exchange | None = None


@dataclass(frozen=True)
class SpecialGoal:
    """A goal that was put because of one thing that is special about it.

    Attributes:
        special: that thing, as a noun phrase: "a quaternion of length 2".
        exchange: of the PUT.
    """

    special: str
    exchange: Exchange


@dataclass(frozen=True)
class FarGoal:
    """A goal outside every map that was put.

    Attributes:
        exchange: of the PUT.
        read: of the last GET of the goal; None: the goal was not accepted, so it was not read.
        waited_s: how long the robot had to end the goal, s.
    """

    exchange: Exchange
    read: Exchange | None
    waited_s: float


@dataclass(frozen=True)
class RefusedGoals:
    """Goals that a robot has to refuse, and two that only nearly have to be refused.

    Attributes:
        not_unit: goals with a quaternion whose length is not 1.
        unit: goals with a quaternion whose length is 1 within the tolerance.
        unknown_frames: goals in frames that the robot does not know.
        far: goals outside every map.
    """

    not_unit: tuple[SpecialGoal, ...] = ()
    unit: tuple[SpecialGoal, ...] = ()
    unknown_frames: tuple[SpecialGoal, ...] = ()
    far: tuple[FarGoal, ...] = ()
