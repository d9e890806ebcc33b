"""Plans that were requested, and what came, as values that can be judged without a robot."""

from __future__ import annotations

from dataclasses import dataclass

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.plan import Plan, Start
from conformance.transport.exchange import Exchange


@dataclass(frozen=True)
class PlanRead:
    """A plan that was requested in the frame of goals.

    Attributes:
        goal: where it has to end.
        tolerance_m: how far from there it may end, m.
        exchange: the evidence.
        problem: what is wrong with the response; empty: it has a plan.
        plan: the plan, or None.
        begin: where the request says that the plan begins; None: where the robot is.
        start: where the plan begins and where the robot was; None: the request has a start, or that cannot be said.
    """

    goal: Pose
    tolerance_m: float
    exchange: Exchange
    problem: str
    plan: Plan | None
    begin: Pose | None = None
    start: Start | None = None


@dataclass(frozen=True)
class PlansFromRobot:
    """Plans from where the robot is.

    Attributes:
        reads: those to poses to which there has to be a plan, or was one.
        nowhere: the response to one of the requests, where the robot has no plan to any pose around it.
    """

    reads: tuple[PlanRead, ...] = ()
    nowhere: Exchange | None = None


@dataclass(frozen=True)
class DefaultPlan:
    """A plan whose request leaves out all that may be left out.

    Attributes:
        goal: where it has to end.
        exchange: the evidence.
        problem: what is wrong with the response; empty: it has a plan.
        plan: the plan, or None.
        explicit: the plan for the same request with the defaults written out.
    """

    goal: Pose
    exchange: Exchange
    problem: str
    plan: Plan | None
    explicit: Plan


@dataclass(frozen=True)
class PlansFromStart:
    """Plans from a start that the request names.

    Attributes:
        reads: with a heading.
        defaults: without heading, frame and tolerance.
    """

    reads: tuple[PlanRead, ...] = ()
    defaults: tuple[DefaultPlan, ...] = ()


@dataclass(frozen=True)
class FramePlan:
    """A plan that was requested in another frame than that of goals.

    Attributes:
        frame: the frame.
        begin, goal: where the robot is, and where the plan has to end, in that frame.
        exchange: the evidence.
        problem: what is wrong with the response; empty: it has a plan.
        plan: the plan, or None.
        moved_m: how far the robot moved meanwhile, m; None: the frame is unknown, so it has no places.
    """

    frame: str
    begin: Pose
    goal: Pose
    exchange: Exchange
    problem: str
    plan: Plan | None
    moved_m: float | None
