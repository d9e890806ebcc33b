"""Plans: asked for, never driven."""

import itertools
import math

import pytest
from hypothesis import strategies as st

from conformance.packs.table1.robot.geometry import Pose, pose_of, wrapped
from conformance.packs.table1.robot.message_shapes import GET_PLAN, ODOMETRY, read_as
from conformance.packs.table1.robot.plan import START_OFF, Plan, ask, judge_start, plan_of, query, reachable
from conformance.packs.table1.robot.robot import POSE, Robot
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.phase("resting"), pytest.mark.needs("rest")]
# A step that a robot cannot follow without another plan of its own, m.
_LONGEST_STEP = 1.0
_YAW_OFF = 0.2
_EXPECTED = "status 200 with a complete nav_msgs/GetPlan response of one pose at least"
_CANDIDATES = 8


@pytest.fixture
def here(robot: Robot) -> Pose:
    """Where the robot is, in the frame of plans."""
    pose = robot.map_pose()
    if pose is None:
        pytest.skip("the robot's pose cannot be read")
    return pose


def _judge_plan(judge: Judge, plan: Plan, goal: Pose, tolerance: float, exchange: Exchange, frame: str) -> None:
    """Judge what holds for every plan."""
    last = plan.poses[-1]
    judge.check(
        "rest-resources/plan-end",
        last.distance(goal) <= tolerance * 1.05 + 0.01,
        exchange,
        f"a path that ends at ({goal.x:.3f}, {goal.y:.3f}) within {tolerance:g} m",
        found=f"({last.x:.3f}, {last.y:.3f})",
        cause="ends elsewhere",
    )
    judge.check(
        "rest-resources/plan-yaw",
        abs(wrapped(last.yaw - goal.yaw)) <= _YAW_OFF,
        exchange,
        f"a last heading of {goal.yaw:.3f} rad",
        found=f"{last.yaw:.3f} rad",
        cause="another heading",
    )
    judge.check(
        "rest-resources/plan-continuous",
        plan.longest_step <= _LONGEST_STEP,
        exchange,
        f"no step of more than {_LONGEST_STEP:g} m",
        found=f"a step of {plan.longest_step:.3f} m",
    )
    judge.check(
        "rest-resources/plan-frame",
        plan.frames == {frame},
        exchange,
        f"path and poses in {frame}",
        found=", ".join(sorted(map(repr, plan.frames))),
    )


@pytest.mark.requirement(
    "rest-resources/plan-type",
    "rest-resources/plan-start",
    "rest-resources/plan-end",
    "rest-resources/plan-yaw",
    "rest-resources/plan-continuous",
    "rest-resources/plan-frame",
)
def test_plans_from_the_robot(robot: Robot, here: Pose, judge: Judge, explore: Explorer) -> None:
    """Paths to poses around the robot, near and farther, begin where it is and end where they should."""
    found = reachable(robot, here, robot.statement.motion.radius_m)
    if not found:
        _, _, exchange = ask(robot, here.ahead(robot.statement.motion.radius_m))
        judge.check(
            "rest-resources/plan-type", False, exchange, f"a plan to one of {_CANDIDATES} poses around the robot"
        )
        return
    frame = robot.statement.motion.frame

    def try_goal(case: tuple[float, float, float, float], *, known: bool = False) -> None:
        distance, turn, yaw, tolerance = case
        before = robot.map_pose()
        goal = here.ahead(distance, turn)._replace(yaw=yaw)
        problem, plan, exchange = ask(robot, goal, tolerance=tolerance)
        if not known and 400 <= exchange.response.status < 500:
            return  # something stands there
        judge.check("rest-resources/plan-type", not problem, exchange, _EXPECTED, found=problem)
        if plan is not None and before is not None:
            _judge_plan(judge, plan, goal, tolerance, exchange, frame)
            judge_start(robot, plan, before, exchange, lambda: ask(robot, goal, tolerance=tolerance)[1])

    for goal in found:
        turn = wrapped(math.atan2(goal.y - here.y, goal.x - here.x) - here.yaw)
        try_goal((here.distance(goal), turn, goal.yaw, 0.1), known=True)
    explore(
        st.tuples(
            st.one_of(st.floats(0.3, 1.0), st.floats(1.0, 6.0)),
            st.floats(-math.pi, math.pi),
            st.floats(-math.pi, math.pi),
            st.sampled_from((0.1, 0.2, 0.5)),
        ),
        try_goal,
        cases=40,
    )


@pytest.mark.requirement("rest-resources/plan-given-start", "rest-resources/plan-end", "rest-resources/plan-defaults")
def test_plans_from_a_given_start(robot: Robot, here: Pose, judge: Judge, explore: Explorer) -> None:
    """Paths begin at the start that is given, and what is left out has its default."""
    starts = reachable(robot, here, max(1.0, robot.statement.motion.radius_m), 3)
    if len(starts) < 2:
        pytest.skip("the robot has no plan to two poses around it")

    def try_start(case: tuple[int, int, float]) -> None:
        index, shift, yaw = case
        start = starts[index % len(starts)]
        goal = starts[(index + 1 + shift % (len(starts) - 1)) % len(starts)]._replace(yaw=yaw)
        problem, plan, exchange = ask(robot, goal, start)
        judge.check(
            "rest-resources/plan-given-start",
            plan is not None and plan.poses[0].distance(start) <= START_OFF,
            exchange,
            f"a path that starts at ({start.x:.3f}, {start.y:.3f})",
            found=problem or (f"({plan.poses[0].x:.3f}, {plan.poses[0].y:.3f})" if plan else ""),
            cause=problem or "starts elsewhere",
        )
        if plan is not None:
            _judge_plan(judge, plan, goal, 0.1, exchange, robot.statement.motion.frame)

    explore(st.tuples(st.integers(0, 2), st.integers(0, 2), st.floats(-math.pi, math.pi)), try_start, cases=12)
    for start, goal in itertools.pairwise(starts):
        _judge_defaults(robot, judge, start, goal._replace(yaw=0.0))


def _judge_defaults(robot: Robot, judge: Judge, start: Pose, goal: Pose) -> None:
    given = {"x": goal.x, "y": goal.y, "start_x": start.x, "start_y": start.y}
    explicit, _ = robot.read(query(**given, yaw=0.0, frame_id="map", tolerance=0.1), GET_PLAN)
    exchange = robot.get(query(**given))
    message, problem = read_as(exchange.response, GET_PLAN)
    if explicit is None:
        return  # there may be no plan in that frame
    wanted, found = plan_of(explicit), None if problem else plan_of(message)
    if found is not None:
        one, other = found.poses[-1], wanted.poses[-1]
        if one.distance(goal) > 0.11:
            problem = f"an end {one.distance(goal):.3f} m away from the goal"
        elif abs(wrapped(one.yaw - other.yaw)) > _YAW_OFF:
            problem = f"a last heading of {one.yaw:.3f} rad for {other.yaw:.3f}"
        elif found.frames != wanted.frames:
            problem = f"frames {sorted(found.frames)} for {sorted(wanted.frames)}"
        elif found.poses[0].distance(wanted.poses[0]) > START_OFF:
            problem = f"a start {found.poses[0].distance(wanted.poses[0]):.3f} m away from the other's"
    judge.check(
        "rest-resources/plan-defaults",
        not problem,
        exchange,
        "the plan that yaw=0, frame_id=map and tolerance=0.1 give",
        found=problem,
    )


@pytest.mark.requirement("rest-resources/plan-frame", "rest-resources/plan-start", "rest-resources/plan-end")
def test_plan_in_other_frames(robot: Robot, here: Pose, judge: Judge) -> None:
    """A plan asked for in another frame is in that frame, its numbers too, or refused."""
    odometry, _ = robot.read(POSE, ODOMETRY)
    if odometry is None:
        pytest.skip("the robot's pose cannot be read")
    # In a frame that nobody knows there is no plan; a path in another one than was asked for is none either.
    for frame, there in ((odometry["header"]["frame_id"], pose_of(odometry["pose"]["pose"])), ("no_such_frame", here)):
        goal = there._replace(x=there.x + 0.3)
        exchange = robot.get(query(x=goal.x, y=goal.y, frame_id=frame))
        message, problem = read_as(exchange.response, GET_PLAN)
        plan = None if problem else plan_of(message)
        if 400 <= exchange.response.status < 500:
            problem = ""
        elif plan is not None and plan.frames != {frame}:
            problem = f"frames {sorted(plan.frames)}"
        judge.check(
            "rest-resources/plan-frame", not problem, exchange, f"path and poses in {frame!r}, or 4xx", found=problem
        )
        if plan is not None and not problem and there is not here:
            _judge_place(robot, judge, plan, there, goal, exchange)


def _judge_place(robot: Robot, judge: Judge, plan: Plan, there: Pose, goal: Pose, exchange: Exchange) -> None:
    """Judge that a path in the odometry's frame leads from where the odometry says to the goal."""
    odometry, _ = robot.read(POSE, ODOMETRY)
    moved = 0.0 if odometry is None else there.distance(pose_of(odometry["pose"]["pose"]))
    for id_, pose, wanted, off in (
        ("rest-resources/plan-start", plan.poses[0], there, START_OFF + moved),
        ("rest-resources/plan-end", plan.poses[-1], goal, 0.1 * 1.05 + 0.01),
    ):
        judge.check(
            id_,
            pose.distance(wanted) <= off,
            exchange,
            f"({wanted.x:.3f}, {wanted.y:.3f}) in the odometry's frame",
            found=f"({pose.x:.3f}, {pose.y:.3f})",
            cause="odometry's frame",
        )


@pytest.mark.requirement("rest-resources/plan-none")
def test_no_plan(robot: Robot, judge: Judge) -> None:
    """To where no map reaches there is no plan."""
    for x, y in ((1e6, 1e6), (-1e6, 0.0), (0.0, -1e9), (1e300, -1e300)):
        exchange = robot.get(query(x=x, y=y))
        judge.check(
            "rest-resources/plan-none",
            400 <= exchange.response.status < 500,
            exchange,
            "422 (another 4xx conforms) where there is no plan",
        )
