"""Request plans from the robot, and find poses near the robot that it can reach."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any, Final
from urllib.parse import urlencode

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.questions import Question
from conformance.api.soap.service import SoapService
from conformance.packs.table1.robot import soap_services
from conformance.packs.table1.robot.geometry import Pose, pose_of
from conformance.packs.table1.robot.message_shapes import GET_PLAN, read_as
from conformance.packs.table1.robot.robot import PLAN, Robot
from conformance.packs.table1.robot.state_read import value_in
from conformance.transport.exchange import Exchange, Response
from conformance.verdict.evidence import Case

_TURNS: Final = tuple(math.radians(angle) for angle in (0, 40, -40, 80, -80, 130, -130, 180))
# A path longer than this multiple of the distance avoids an obstacle, and is too long for a short drive.
_DETOUR: Final = 1.3
# A plan that ends within this distance ends at the pose itself, and not only within its tolerance, m.
EXACT: Final = 1e-6
# A plan that ends farther away than this was made for another place, m.
_BESIDE: Final = 0.3
# How far from the robot or the given start a path may begin, m: a planner's grid may be that coarse.
START_OFF: Final = 0.25
# Notations of a number beside the shortest: with an exponent, with a sign, with other digits before the dot.
NOTATIONS: Final[tuple[Callable[[float], str], ...]] = (
    lambda value: f"{value:.17e}",
    lambda value: f"{value:+.20e}",
    lambda value: f"{value:+.17f}".replace("0.", ".", 1) if abs(value) < 1 else f"00{value:.17f}".replace("00-", "-00"),
)
# Plans and readings that must agree before a path's start counts as wrong.
_STARTS: Final = 3


@dataclass(frozen=True)
class Plan:
    """A plan (nav_msgs/Path).

    Attributes:
        frames: the frames of the path and of its poses.
        poses: the path; at least one pose.
    """

    frames: frozenset[str]
    poses: tuple[Pose, ...]

    @property
    def length(self) -> float:
        """Return the length of the path, m."""
        return sum(one.distance(two) for one, two in itertools.pairwise(self.poses))

    @property
    def longest_step(self) -> float:
        """Return the largest distance between two successive poses, m."""
        return max((one.distance(two) for one, two in itertools.pairwise(self.poses)), default=0.0)


def plan_of(message: Any) -> Plan:
    """Return the plan in a nav_msgs/GetPlan response that satisfies the schema."""
    path = message["plan"]
    frames = {path["header"]["frame_id"], *(pose["header"]["frame_id"] for pose in path["poses"])}
    return Plan(frozenset(frames), tuple(pose_of(pose["pose"]) for pose in path["poses"]))


def query(**parameters: float | str | None) -> str:
    """Return the path and query of a plan request, without the parameters that are None."""
    given = {
        name: value if isinstance(value, str) else repr(float(value))
        for name, value in parameters.items()
        if value is not None
    }
    return f"{PLAN}?{urlencode(given)}"


def ask(
    robot: Robot, goal: Pose, start: Pose | None = None, **more: float | str | None
) -> tuple[str, Plan | None, Exchange]:
    """Request a plan in the frame of goals.

    Returns:
        What is wrong with the response (empty for a plan), the plan, and the exchange.
    """
    parameters: dict[str, float | str | None] = {"x": goal.x, "y": goal.y, "yaw": goal.yaw}
    if start is not None:
        parameters |= {"start_x": start.x, "start_y": start.y, "start_yaw": start.yaw}
    parameters |= more
    if robot.statement.motion.frame != "map":
        parameters.setdefault("frame_id", robot.statement.motion.frame)
    exchange = robot.get(query(**parameters))
    message, problem = read_as(exchange.response, GET_PLAN)
    return problem, None if problem else plan_of(message), exchange


def ask_over_soap(robot: Robot, subscribers: SoapService, goal: Pose) -> tuple[Plan | None, Exchange]:
    """Request a plan from the robot's place over SOAP; return None if the response has none."""
    frame = robot.statement.motion.frame
    named = {} if frame == "map" else {"frame_id": frame}
    exchange = soap_services.ask(subscribers, "GetPlan", x=goal.x, y=goal.y, **named)
    message, problem = value_in(exchange, GET_PLAN)
    return None if problem or GET_PLAN.problem(message) else plan_of(message), exchange


def reachable(robot: Robot, here: Pose, distance: float, count: int = 1) -> list[Pose]:
    """Return poses inside the arena, about ``distance`` metres away, to which the robot has a plan without a detour.

    The statement's goals come first where they are about that far away. Where there is no such pose, the distance is
    halved up to twice.
    """
    found = [
        pose
        for pose in itertools.starmap(Pose, robot.statement.motion.goals)
        if distance / 2 <= here.distance(pose) <= 2 * distance
    ][:count]
    round_about: list[Pose] = []
    for reach in (distance, distance / 2, distance / 4):
        for turn in _TURNS:
            if len(found) >= count:
                return found
            goal = here.ahead(reach, turn)
            if not robot.in_arena(goal):
                continue
            _, plan, _ = ask(robot, goal)
            if plan is not None:
                # A plan may end near its goal, within the tolerance, if the goal is too near an obstacle. The plan's
                # end is a place that the robot can reach.
                end = plan.poses[-1]
                beside = EXACT <= end.distance(goal) < _BESIDE and robot.in_arena(end)
                goal = Pose(end.x, end.y, goal.yaw) if beside else goal
                plain = not beside and plan.length <= _DETOUR * here.distance(goal) + 0.1
                (found if plain else round_about).append(goal)
    # If no way is straight, take any: other checks judge the plans.
    return [*found, *round_about][:count]


@dataclass(frozen=True)
class Start:
    """Where a plan's path begins, compared with the robot's position.

    Attributes:
        first: the first pose of the path.
        robot: the robot's pose just before the plan was requested.
        exchange: the plan's request and response.
        beyond_m: for each plan requested, how much farther from the robot its path begins than it may, m.
    """

    first: Pose
    robot: Pose
    exchange: Exchange
    beyond_m: tuple[float, ...]

    @property
    def case(self) -> Case:
        """Judge whether the path begins at the robot, by the median of the plans, as single readings may be wrong."""
        return Case(
            self.beyond_m[0] <= 0 or median(self.beyond_m) <= 0,
            self.exchange,
            f"a path that starts at the robot, ({self.robot.x:.3f}, {self.robot.y:.3f})",
            f"({self.first.x:.3f}, {self.first.y:.3f})",
            "starts elsewhere",
        )


def start_of(
    robot: Robot, plan: Plan, before: Pose, exchange: Exchange, again: Callable[[], Plan | None]
) -> Start | None:
    """Return where a path begins; None where the robot's pose cannot be read.

    Args:
        robot: the robot.
        plan: the plan with the path.
        before: the robot's pose just before the plan was requested; it may have moved since.
        exchange: the plan's request and response.
        again: requests the same plan once more, where the path does not begin at the robot.
    """
    after = robot.map_pose()
    if after is None:
        return None
    offs = [_beyond_start(plan, before, after)]
    while offs[0] > 0 and len(offs) < _STARTS:
        earlier, other, later = robot.map_pose(), again(), robot.map_pose()
        if earlier is None or other is None or later is None:
            break
        offs.append(_beyond_start(other, earlier, later))
    return Start(plan.poses[0], before, exchange, tuple(offs))


def _beyond_start(plan: Plan, before: Pose, after: Pose) -> float:
    """Return how much farther from the robot a path begins than it may, m; zero or less where it conforms."""
    return plan.poses[0].distance(before) - START_OFF - before.distance(after)


_PLACES = 4
_FAR_M = 1.0
# Two places must be this far apart to be distinguished by the end of a plan, m.
_APART_M = 0.4


def plan_questions(api: RestInterface) -> list[Question]:
    """Return requests for plans to places around the robot; none where the robot or the contract has no plans."""
    robot = Robot(api)
    here = robot.map_pose()
    places: list[Pose] = []
    for place in reachable(robot, here, _FAR_M, _PLACES) if here is not None else []:
        if all(place.distance(other) > _APART_M for other in places):
            places.append(place)
    return [
        Question(query(x=place.x, y=place.y, yaw=place.yaw, frame_id=robot.statement.motion.frame), JSON, other)
        for place in places
        for other in [_ends_elsewhere(place, [pose for pose in places if pose is not place])]
    ]


def _ends_elsewhere(place: Pose, others: list[Pose]) -> Callable[[Response], str]:
    """Return a function that reports when a response's path ends nearer to another request's goal."""

    def mismatch(answer: Response) -> str:
        message, problem = read_as(answer, GET_PLAN)
        if problem:
            return problem if answer.ok else ""
        end = plan_of(message).poses[-1]
        nearer = [other for other in others if end.distance(other) < end.distance(place)]
        return f"a path to ({end.x:.3f}, {end.y:.3f}) for ({place.x:.3f}, {place.y:.3f})" if nearer else ""

    return mismatch
