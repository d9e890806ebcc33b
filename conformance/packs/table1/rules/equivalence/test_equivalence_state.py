"""REST and SOAP must show the same state, also while the robot moves and when it has come to rest."""

import itertools
from collections import deque
from collections.abc import Callable, Iterator
from decimal import Decimal
from functools import partial
from operator import attrgetter
from typing import Any, Final

import pytest

from conformance.api.rest.effects import steady
from conformance.api.soap.service import SoapService
from conformance.documents.json_shape import Shape
from conformance.documents.representation import flattened, projected
from conformance.packs.table1.checkers.state import BesideOdometry, Place
from conformance.packs.table1.robot.drive_rules import Driven
from conformance.packs.table1.robot.geometry import Pose, pose_of
from conformance.packs.table1.robot.message_shapes import GET_PLAN, ODOMETRY, TWIST
from conformance.packs.table1.robot.plan import plan_of, query, reachable
from conformance.packs.table1.robot.robot import POSE, SENSORS, SERVICES, STILL, Odometry, Robot, Velocity
from conformance.packs.table1.robot.soap_services import ask, outgoing, request
from conformance.packs.table1.robot.state_read import (
    STATES,
    Slack,
    StateRead,
    compare,
    disagreement,
    value_in,
    without_stamps,
)
from conformance.packs.table1.scenarios.interfaces_in_motion import goals_over_soap, interfaces_in_motion
from conformance.packs.table1.scenarios.turn import turn
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Outcome, Rule, record, rule
from conformance.scenarios.scenario import Scenario
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import MOST_CLIENTS, is_busy, send_together
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run

pytestmark = pytest.mark.needs("rest", "subscribers")
_SAME: Final = Slack(0.0, 0.0)
# Larger than any tolerance that is requested here, m.
_END_OFF: Final = 0.3
# Comparisons at standard effort, which find a state that is wrong once in sixty responses: _POSES, and _VELOCITIES, for
# which at most the multiple below is read.
_POSES: Final = 200
_VELOCITIES: Final = 320
_READ: Final = 4
_TURNS: Final = 5  # of this many turns, one begins with a refused request, and one with a request that acts
_NOT_ACCEPTABLE: Final = (("Accept", "image/png"),)
_ALONE: Final = 4  # reads of a state over REST before the SOAP reads, and after them
_ROUNDS: Final = 10  # rounds of several clients
_MOST: Final = 0.8  # a state changes if this share of the responses differ: noise may repeat a value, but less often
_REPEATS: Final = 3
# A response that differs, the known value, and the other one, by place.
_Odd = dict[str, tuple[Exchange, Any, Any]]
# Difference between the headings of plans, rad: small ones are among them.
_STEP: Final = 0.07
# How far ahead of the robot a plan in the odometry's frame ends, m.
_AHEAD: Final = 0.3


def _event(robot: Robot, turn: int) -> None:
    """Send, in some turns, a request that a robot which mixes requests up applies to the next one."""
    if turn % _TURNS == 0:
        robot.rest.send("GET", POSE, headers=_NOT_ACCEPTABLE)
    elif turn % _TURNS == 1 and robot.may_move:
        robot.put_velocity(STILL)


@pytest.mark.phase("resting")
@pytest.mark.requirement("equivalence/pose", "equivalence/velocity")
def test_pose_and_velocity(robot: Robot, subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Compare pose and velocity over REST and SOAP, whatever the robot is doing."""
    for number in range(effort.cases(_POSES)):
        for name in STATES if number < effort.cases(50) else ("pose",):
            if (
                evidence := judge.of(f"equivalence/{name}")
            ) is None or not evidence.findings:  # a failure costs three tries each time
                found = compare(robot, subscribers, name, first=partial(_event, robot, number))
                outcomes = (case for read in found for case in read.cases)
                record(judge, f"equivalence/{name}", outcomes)


@pytest.mark.phase("resting")
@pytest.mark.requirement("equivalence/pose", "equivalence/velocity")
def test_pose_and_velocity_at_one_moment(robot: Robot, subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Read pose and velocity over SOAP by several clients at once: most responses must agree with a steady REST."""
    for name, (path, _, _) in STATES.items():
        odd: _Odd = {}
        for number in range(_REPEATS):
            found = _odd_at_one_moment(robot, subscribers, name, effort)
            if found is None:
                return  # which the checkers have judged
            odd = {place: one for place, one in found.items() if not number or place in odd}
            if not odd:
                break
        place, (exchange, known, seen) = next(iter(odd.items()), ("", (None, None, None)))
        judge.check(
            f"equivalence/{name}",
            not odd,
            exchange,
            f"the {place} that GET {path} shows before and after it, {known!r}",
            found=f"another value in most responses to clients at the same moment, such as {seen!r}" if odd else "",
            cause=f"{place} at once",
        )


def _odd_at_one_moment(robot: Robot, subscribers: SoapService, name: str, effort: Effort) -> _Odd | None:
    """Read a state by several clients at once; return where most responses differ from REST's before and after.

    None: the readings over REST cannot be read.
    """
    path, operation, shape = STATES[name]
    alone = [robot.read(path, shape)[0] for _ in range(_ALONE)]
    question = outgoing(subscribers, request(operation))
    came = send_together([[question] * MOST_CLIENTS] * effort.cases(_ROUNDS))
    alone += [robot.read(path, shape)[0] for _ in range(_ALONE)]
    if None in alone:
        return None
    known = steady(flattened(projected(value, shape.schema)) for value in alone)
    readings: list[tuple[Exchange, dict[str, Any]]] = []
    for exchange in itertools.chain(*came):
        if isinstance(exchange, Exchange) and not is_busy(exchange):
            value, problem = value_in(exchange, shape)
            # The fault may be of either interface; other problems are judged in any response.
            readings += [] if problem or shape.problem(value) else [(exchange, flattened(value))]
    odd: _Odd = {}
    for place, wanted in known.items():
        others = [(exchange, leaves[place]) for exchange, leaves in readings if leaves.get(place, wanted) != wanted]
        if len(others) > _MOST * len(readings):
            odd[place] = (others[0][0], wanted, others[0][1])
    return odd


@pytest.mark.phase("resting")
@pytest.mark.requirement("equivalence/velocity")
def test_single_velocities(robot: Robot, subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Compare each velocity over SOAP with the odometry around it, to find intermittent faults; not at quick."""
    if effort.name == "quick":
        return  # too few readings to notice a fault
    beside = BesideOdometry[Velocity](robot.limits)
    for _ in range(_READ * effort.cases(_VELOCITIES)):
        odometry = robot.odometry()
        exchange = ask(subscribers, "GetVelocity")
        twist, problem = value_in(exchange, TWIST)
        if odometry is None or problem or TWIST.problem(twist):
            return  # judged by those who compare all of it
        outcomes = beside.odometry(odometry.stamp, odometry.velocity, odometry.received)
        record(judge, "equivalence/velocity", outcomes)
        beside.reading(Velocity.of(twist), exchange, exchange.response.received_s)
        if beside.judged == effort.cases(_VELOCITIES):
            return


@pytest.mark.phase("resting")
@pytest.mark.requirement("equivalence/sensors", "equivalence/services")
def test_lists(robot: Robot, subscribers: SoapService, effort: Effort) -> None:
    """Read the lists over REST, SOAP and REST; a checker compares their entries, in any order."""
    for number in range(effort.cases(50)):
        for path, operation in ((SENSORS, "GetSensors"), (SERVICES, "GetNavigationServices")):
            robot.get(path)
            _event(robot, number)
            ask(subscribers, operation)
            robot.get(path)


def _all_digits(value: float | str) -> float | str:
    """Return a number as text with all its decimal digits, some fifty: the same double as in its shortest notation."""
    return value if isinstance(value, str) else f"{Decimal(value):f}"


@pytest.mark.phase("resting")
@pytest.mark.requirement("equivalence/plan")
def test_plan(robot: Robot, subscribers: SoapService, judge: Judge, effort: Effort) -> None:
    """Request the same plan over REST and SOAP, with all parameters, with few, and in the odometry frame."""
    odometry, _ = robot.read(POSE, ODOMETRY)
    here = robot.in_map(pose_of(odometry["pose"]["pose"])) if odometry else None
    goals = reachable(robot, here, max(1.0, robot.statement.motion.radius_m), 3) if here else []
    if not goals:
        pytest.skip("the robot has no plan to any pose around it")
    frame = robot.statement.motion.frame
    for index in range(effort.cases(20)):
        goal, start = goals[index % len(goals)], goals[(index + 1) % len(goals)]
        few: dict[str, float | str] = {"x": goal.x, "y": goal.y}
        if frame != "map":
            few["frame_id"] = frame
        yaw = _STEP * index * (-1) ** index
        full: dict[str, float | str] = {"x": goal.x, "y": goal.y, "yaw": yaw, "frame_id": frame}
        full |= {"tolerance": 0.2, "start_x": start.x, "start_y": start.y, "start_yaw": start.yaw}
        there = pose_of(odometry["pose"]["pose"]).ahead(_AHEAD)
        other: dict[str, float | str] = {"x": there.x, "y": there.y, "frame_id": odometry["header"]["frame_id"]}
        for end, parameters in ((goal, few), (there, other), (goal, full)):
            first = partial(_event, robot, index)
            _compare_plans(robot, subscribers, judge, end, parameters, first, in_full=index % 2 == 1)


def _compare_plans(
    robot: Robot,
    subscribers: SoapService,
    judge: Judge,
    goal: Pose,
    parameters: dict[str, float | str],
    first: Callable[[], object],
    *,
    in_full: bool,
) -> None:
    before, _ = robot.read(query(**parameters), GET_PLAN)
    first()
    written = {name: _all_digits(value) if in_full else value for name, value in parameters.items()}
    exchange = ask(subscribers, "GetPlan", **written)
    between, problem = value_in(exchange, GET_PLAN)
    after, _ = robot.read(query(**parameters), GET_PLAN)
    if before is None or after is None:
        return
    problem = problem or GET_PLAN.problem(between)
    if not problem and without_stamps(before) == without_stamps(after):
        problem = disagreement(without_stamps(before), without_stamps(between), without_stamps(after), _SAME)
    elif not problem and plan_of(between).poses[-1].distance(goal) > _END_OFF:
        # A planner may answer the same request differently each time; then only the goal must be the same.
        problem = "the end is another one"
    elif not problem and plan_of(between).frames != plan_of(after).frames:
        problem = f"the frame is {min(plan_of(between).frames)}"
    judge.check(
        "equivalence/plan",
        not problem,
        exchange,
        f"the plan to ({goal.x:.3f}, {goal.y:.3f}) that REST gives",
        found=problem,
        cause=problem.split(" is ")[0].split("[")[0],
    )


def _same(name: str, scenario: Scenario) -> Rule:
    """Return a rule that judges whether both interfaces show the same state."""

    def judge(trace: tuple[StateRead, ...]) -> Iterator[Outcome]:
        return (case for read in trace if read.name == name for case in read.cases)

    return rule(f"equivalence/{name}", on=(scenario,))(judge)


pose = _same("pose", interfaces_in_motion)
velocity = _same("velocity", interfaces_in_motion)
goal = _same("goal", goals_over_soap)


def _beside(operation: str, shape: Shape, over_soap: Callable[[Any], Any], of: Callable[[Odometry], Any]) -> Rule:
    """Return a rule that compares a state over SOAP with the odometry around it, at every heading.

    Args:
        operation: the operation that returns the state.
        shape: its shape.
        over_soap: returns the value to compare.
        of: returns that of an odometry.
    """

    def judge(trace: Driven, run: Run) -> Iterator[Outcome]:
        beside = BesideOdometry[Any](said_of(run).limits)
        reads = deque(one for one in trace.over_soap if operation.encode() in one.request.body)
        for odometry in trace.drive.odometry:
            while reads and reads[0].response.received_s < odometry.received:
                exchange = reads.popleft()
                value, problem = value_in(exchange, shape)
                # A value with a wrong shape is judged where whole states are compared.
                if not problem and not shape.problem(value):
                    beside.reading(over_soap(value), exchange, exchange.response.received_s)
            yield from beside.odometry(odometry.stamp, of(odometry), odometry.received)

    return rule(f"equivalence/{operation.removeprefix('Get').lower()}", on=(turn,))(judge)


pose_turning = _beside(
    "GetPose",
    ODOMETRY,
    lambda value: Place.of(pose_of(value["pose"]["pose"])),
    lambda odometry: Place.of(odometry.pose),
)
twist_turning = _beside("GetPose", ODOMETRY, lambda value: Velocity.of(value["twist"]["twist"]), attrgetter("velocity"))
velocity_turning = _beside("GetVelocity", TWIST, Velocity.of, attrgetter("velocity"))
