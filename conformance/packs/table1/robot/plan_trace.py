"""Records of plan requests and their responses, as data that rules can judge without a robot."""

from dataclasses import dataclass

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.plan import Plan, Start
from conformance.transport.exchange import Exchange


@dataclass(frozen=True)
class PlanRead:
    """A plan requested in the frame of goals.

    Attributes:
        exchange: the plan's request and response.
        problem: what is wrong with the response; empty: it has a plan.
        start: where the plan begins compared with the robot; None where the request has a start or the pose is unknown.
    """

    exchange: Exchange
    problem: str
    start: Start | None = None


@dataclass(frozen=True)
class PlansFromRobot:
    """Plans that start at the robot.

    Attributes:
        reads: plans to poses to which the robot must have a plan, or had one.
        nowhere: one of the responses, where the robot has no plan to any pose around it.
    """

    reads: tuple[PlanRead, ...] = ()
    nowhere: Exchange | None = None


@dataclass(frozen=True)
class DefaultPlan:
    """A plan whose request equals another one's: it leaves out defaults, or writes numbers in another form.

    Attributes:
        goal: where the plan must end.
        exchange: the plan's request and response.
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
    """Plans from a start given in the request.

    Attributes:
        reads: requests with a heading.
        defaults: requests without heading, frame and tolerance.
        written: requests with the defaults, whose numbers are written in another notation.
    """

    reads: tuple[PlanRead, ...] = ()
    defaults: tuple[DefaultPlan, ...] = ()
    written: tuple[DefaultPlan, ...] = ()


@dataclass(frozen=True)
class FramePlan:
    """A plan requested in another frame than that of goals.

    Attributes:
        frame: the frame.
        begin: the robot's position in that frame.
        exchange: the plan's request and response.
        problem: what is wrong with the response; empty: it has a plan.
        plan: the plan, or None.
        moved_m: how far the robot moved in the meantime, m; None: the frame is unknown to the suite.
    """

    frame: str
    begin: Pose
    exchange: Exchange
    problem: str
    plan: Plan | None
    moved_m: float | None
