"""Plans that are requested, and never driven.

Where the robot does not respond to a request, there is no trace: the requirements of the scenario fail by that.
"""

import itertools
import math
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final

from hypothesis import strategies as st

from conformance.packs.table1.robot.geometry import Pose, pose_of
from conformance.packs.table1.robot.message_shapes import GET_PLAN, ODOMETRY, read_as
from conformance.packs.table1.robot.plan import NOTATIONS, Plan, Start, ask, plan_of, query, reachable, start_of
from conformance.packs.table1.robot.robot import POSE, Robot
from conformance.scenarios.scenario import NoOccasionError, NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.explorer import Explorer


@dataclass(frozen=True)
class PlanRead:
    """A plan requested in the frame of goals.

    Attributes:
        exchange: the plan's request and response.
        problem: what is wrong with the response; empty if it has a plan.
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
        problem: what is wrong with the response; empty if it has a plan.
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
        problem: what is wrong with the response; empty if it has a plan.
        plan: the plan, or None.
        moved_m: how far the robot moved in the meantime, m; None if the frame is unknown to the suite.
    """

    frame: str
    begin: Pose
    exchange: Exchange
    problem: str
    plan: Plan | None
    moved_m: float | None


_DEFAULT_TOLERANCE_M: Final = 0.1
_UNKNOWN_FRAME: Final = "no_such_frame"
_NO_MAP: Final = ((1e6, 1e6), (-1e6, 0.0), (0.0, -1e9), (1e300, -1e300))
_UNREADABLE: Final = "the robot's pose cannot be read"


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.RESTING)
def plans_from_robot(robot: Robot, explore: Explorer) -> PlansFromRobot:
    """Request plans from the robot's pose to poses around it, near and farther."""
    here = _here(robot)
    found = reachable(robot, here, robot.statement.motion.radius_m)
    if not found:
        _, _, exchange = ask(robot, here.ahead(robot.statement.motion.radius_m))
        return PlansFromRobot(nowhere=exchange)
    reads: list[PlanRead] = []

    def request(goal: Pose, tolerance_m: float, *, known: bool = False) -> None:
        before = robot.map_pose()
        problem, plan, exchange = ask(robot, goal, tolerance=tolerance_m)
        if not known and is_refused(exchange):
            return  # an obstacle stands there
        start = None
        if plan is not None and before is not None:
            start = start_of(robot, plan, before, exchange, lambda: ask(robot, goal, tolerance=tolerance_m)[1])
        reads.append(PlanRead(exchange, problem, start))

    for goal in found:
        request(goal, _DEFAULT_TOLERANCE_M, known=True)
    explore(
        st.tuples(
            st.one_of(st.floats(0.3, 1.0), st.floats(1.0, 6.0)),
            st.floats(-math.pi, math.pi),
            st.floats(-math.pi, math.pi),
            st.sampled_from((0.1, 0.2, 0.5, 0.0)),
        ),
        lambda case: request(here.ahead(case[0], case[1])._replace(yaw=case[2]), case[3]),
        cases=40,
    )
    return PlansFromRobot(tuple(reads))


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def plans_from_start(robot: Robot, explore: Explorer) -> PlansFromStart:
    """Request plans from a start in the request, also without the parameters that have a default."""
    starts = reachable(robot, _here(robot), max(1.0, robot.statement.motion.radius_m), 3)
    if len(starts) < 2:  # noqa: PLR2004 - a start and a goal
        raise NoOccasionError("the robot has no plan to two poses around it")
    reads: list[PlanRead] = []

    def request(case: tuple[int, int, float]) -> None:
        index, shift, yaw = case
        start = starts[index % len(starts)]
        goal = starts[(index + 1 + shift % (len(starts) - 1)) % len(starts)]._replace(yaw=yaw)
        problem, _, exchange = ask(robot, goal, start)
        reads.append(PlanRead(exchange, problem))

    explore(st.tuples(st.integers(0, 2), st.integers(0, 2), st.floats(-math.pi, math.pi)), request, cases=12)
    pairs = ((start, goal._replace(yaw=0.0)) for start, goal in itertools.pairwise(starts))
    defaults = (_by_default(robot, start, goal) for start, goal in pairs)
    written = _otherwise_written(robot, starts[0], starts[1]._replace(yaw=-0.5))
    return PlansFromStart(tuple(reads), tuple(plan for plan in defaults if plan is not None), written)


def _by_default(robot: Robot, start: Pose, goal: Pose) -> DefaultPlan | None:
    """Request a plan with and without default values in the request; return None if there is no plan with them."""
    given = {"x": goal.x, "y": goal.y, "start_x": start.x, "start_y": start.y}
    explicit, _ = robot.read(query(**given, yaw=0.0, frame_id="map", tolerance=_DEFAULT_TOLERANCE_M), GET_PLAN)
    exchange = robot.get(query(**given))
    message, problem = read_as(exchange.response, GET_PLAN)
    if explicit is None:
        return None  # there may be no plan in that frame
    return DefaultPlan(goal, exchange, problem, None if problem else plan_of(message), plan_of(explicit))


def _otherwise_written(robot: Robot, start: Pose, goal: Pose) -> tuple[DefaultPlan, ...]:
    """Request one plan with its numbers in each notation that the contract allows (contract.md#numbers)."""
    given = {"x": goal.x, "y": goal.y, "yaw": goal.yaw, "start_x": start.x, "start_y": start.y, "tolerance": 0.1}
    frame = {"frame_id": robot.statement.motion.frame}
    explicit, _ = robot.read(query(**given, **frame), GET_PLAN)
    if explicit is None:
        return ()
    exchanges = [
        robot.get(query(**{name: write(value) for name, value in given.items()}, **frame)) for write in NOTATIONS
    ]
    read = [(exchange, *read_as(exchange.response, GET_PLAN)) for exchange in exchanges]
    return tuple(
        DefaultPlan(goal, exchange, problem, None if problem else plan_of(message), plan_of(explicit))
        for exchange, message, problem in read
    )


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.RESTING)
def plans_in_frames(robot: Robot) -> tuple[FramePlan, ...]:
    """Request a plan in the odometry's frame, and one in an unknown frame."""
    here = _here(robot)
    odometry, _ = robot.read(POSE, ODOMETRY)
    if odometry is None:
        raise NotPossibleError(_UNREADABLE)
    known = _in_frame(robot, odometry["header"]["frame_id"], pose_of(odometry["pose"]["pose"]), known=True)
    return (known, _in_frame(robot, _UNKNOWN_FRAME, here, known=False))


def _in_frame(robot: Robot, frame: str, begin: Pose, *, known: bool) -> FramePlan:
    """Request a plan in a frame to a pose 0.3 m beside ``begin``; ``known``: the robot knows the frame."""
    exchange = robot.get(query(x=begin.x + 0.3, y=begin.y, frame_id=frame))
    message, problem = read_as(exchange.response, GET_PLAN)
    plan, moved_m = None if problem else plan_of(message), None
    if known and plan is not None:
        odometry, _ = robot.read(POSE, ODOMETRY)
        moved_m = 0.0 if odometry is None else begin.distance(pose_of(odometry["pose"]["pose"]))
    return FramePlan(frame, begin, exchange, problem, plan, moved_m)


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def plans_outside(robot: Robot) -> tuple[Exchange, ...]:
    """Request plans to poses outside every map."""
    return tuple(robot.get(query(x=x, y=y)) for x, y in _NO_MAP)


def is_refused(exchange: Exchange) -> bool:
    """Return whether a response is 4xx."""
    return HTTPStatus.BAD_REQUEST <= exchange.response.status < HTTPStatus.INTERNAL_SERVER_ERROR


def _here(robot: Robot) -> Pose:
    """Return where the robot is, in the frame of plans."""
    pose = robot.map_pose()
    if pose is None:
        raise NotPossibleError(_UNREADABLE)
    return pose
