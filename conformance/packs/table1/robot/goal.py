"""Build goals that the robot can reach, send them, and compare the goal in the robot's response with the sent one."""

import math
from collections.abc import Callable, Sequence
from http import HTTPStatus
from typing import Any, Final

from conformance.documents.json_text import clip, read_json
from conformance.observe.clock import poll
from conformance.packs.table1.robot.geometry import Pose, quaternion_of
from conformance.packs.table1.robot.message_shapes import LAST_GOAL, STATUS
from conformance.packs.table1.robot.plan import EXACT, ask, reachable
from conformance.packs.table1.robot.robot import GOAL_PATH, Robot
from conformance.scenarios.scenario import NoOccasionError
from conformance.transport.exchange import Exchange

NEW: Final = frozenset({201, 202})
REPEATED: Final = frozenset({200, 202, 204})
# Statuses for a cancelled goal: the contract has 204, and a response with a body means the same.
CANCELLED: Final = frozenset({200, 202, 204})
# An Accept header with a preference, which must not matter for cancelling.
RATHER_XML: Final = ("Accept", "application/xml, */*;q=0.1")
SUCCEEDED: Final = 4
CANCELED: Final = 5
ACTIVE: Final = frozenset({1, 2, 3})
_STEP_S: Final = 0.02
_CLOSE: Final = 1e-6
# Within this distance of its goal, a robot may end the goal while the suite reads, m.
_ARRIVED_M: Final = 0.1


def goal_body(pose: Pose, frame: str, id_: str | None = None, *, length: float = 1.0) -> dict[str, Any]:
    """Return the JSON body of a goal's PUT (move_base_msgs/MoveBaseActionGoal).

    Args:
        pose: the target.
        frame: frame of the pose.
        id_: goal_id.id, or None: the robot chooses one.
        length: length of the quaternion.
    """
    body: dict[str, Any] = {
        "goal": {
            "target_pose": {
                "header": {"frame_id": frame},
                "pose": {
                    "position": {"x": pose.x, "y": pose.y, "z": 0.0},
                    "orientation": quaternion_of(pose.yaw, length),
                },
            }
        }
    }
    if id_ is not None:
        body["goal_id"] = {"id": id_}
    return body


def difference(goal: Any, put: dict[str, Any]) -> str:
    """Return where the robot's goal differs from the sent one; empty if nowhere.

    A quaternion and its negative are the same orientation.
    """
    if "goal_id" in put and goal["goal_id"]["id"] != put["goal_id"]["id"]:
        return f"goal_id.id {clip(goal['goal_id']['id'])} for {clip(put['goal_id']['id'])}"
    active, wanted = goal["goal"]["target_pose"], put["goal"]["target_pose"]
    if active["header"]["frame_id"] != wanted["header"]["frame_id"]:
        return f"frame_id {clip(active['header']['frame_id'])} for {clip(wanted['header']['frame_id'])}"
    for axis, put_at in wanted["pose"]["position"].items():
        found = float(active["pose"]["position"][axis])
        if not math.isclose(found, put_at, rel_tol=1e-9, abs_tol=_CLOSE):
            return f"position.{axis} {found:g} for {put_at:g}"
    turned, wished = active["pose"]["orientation"], wanted["pose"]["orientation"]
    dot = sum(float(turned[axis]) * wished[axis] for axis in "xyzw")
    length = math.hypot(*(float(turned[axis]) for axis in "xyzw")) * math.hypot(*wished.values())
    if not abs(abs(dot) - length) <= _CLOSE or not length > _CLOSE:
        return f"orientation {clip(turned)} for {clip(wished)}"
    return ""


def status_fault(goal: Any) -> str:
    """Return what is wrong with the status of an active goal, or an empty text."""
    problem = STATUS.problem(goal.get("status"), "status")
    if problem:
        return problem
    code = goal["status"]["code"]
    return "" if code in ACTIVE else f"status.code {code:g}"


def outcome_fault(exchange: Exchange, code: int, id_: str | None = None) -> str:
    """Return what is wrong with the last goal in a problem document, or an empty text.

    Args:
        exchange: a GET of the goal that was answered 404.
        code: the status with which the goal ended (action_msgs/GoalStatus).
        id_: the goal's id; None means any.
    """
    problem = read_json(exchange.response.body).value
    last: Any = problem.get("last_goal") if isinstance(problem, dict) else None
    wrong = "no member last_goal" if last is None else LAST_GOAL.problem(last, "last_goal")
    if wrong:
        return wrong
    if id_ not in {None, last["goal_id"]["id"]}:
        return f"last_goal.goal_id.id {clip(last['goal_id']['id'])}"
    return "" if last["status"]["code"] == code else f"last_goal.status.code {last['status']['code']:g}"


def await_goal(robot: Robot, *put: dict[str, Any]) -> tuple[Any, str, Exchange]:
    """GET the active goal until it is one of the sent ones, at most for the settle time.

    Returns:
        The goal (None: the robot shows no goal), where it differs from those PUT, and the last exchange.
    """
    patience = robot.patience(robot.settle_s)
    for _ in poll(robot.clock, _STEP_S, lambda: patience.over):
        goal, exchange = robot.goal()
        problem = exchange.came if goal is None else min((difference(goal, item) for item in put), key=len)
        if not problem:
            break
    return goal, problem, exchange


def await_none(robot: Robot, seconds: float | None = None) -> Exchange:
    """GET the active goal until there is none, for ``seconds`` or the settle time."""
    patience = robot.patience(robot.settle_s if seconds is None else seconds)
    for _ in poll(robot.clock, _STEP_S, lambda: patience.over):
        exchange = robot.get(GOAL_PATH)
        if exchange.response.status == HTTPStatus.NOT_FOUND:
            break
    return exchange


def is_there(robot: Robot, pose: Pose) -> bool:
    """Return whether the robot is so near a goal that the goal may have ended."""
    here = robot.map_pose()
    return here is None or here.distance(pose) < robot.limits.arrival[0] + _ARRIVED_M


def put_goal(robot: Robot, body: dict[str, Any]) -> Exchange:
    """PUT a goal."""
    return robot.put(GOAL_PATH, body)


# How far velocities may move a robot: _NEAR_M to the side, _FAR_M ahead, m.
_NEAR_M: Final = 0.4
_FAR_M: Final = 0.7
# A robot that cannot reverse needs _ONE_WAY times the room ahead, and _CIRCLE radii to the side in a circle.
_ONE_WAY: Final = 2.0
_CIRCLE: Final = 2.2
_PLACES: Final = 8
# Distances at which free places are looked for, m: the nearest first, because the way takes time.
_DISTANCES_M: Final = (0.3, 0.5, 0.8, 1.5, 2.5)
_FARTHEST_M: Final = 1.5  # distance of a goal that must stay active for a while, m
_ATTEMPTS: Final = 3  # goals that are sent until `act` was in time for one
# Difference between the headings of goals in a series, rad.
_TURN_RAD: Final = 0.37
# How long the suite waits for a robot that makes room, s.
_ARRIVES_S: Final = 10.0


def choose_goals(robot: Robot, distance: float, count: int) -> list[Pose]:
    """Return ``count`` different poses about ``distance`` metres from the robot (nearer where the statement says so).

    The robot has a plan to each, or it lies on the way of one. Where the robot has no plan to any pose nearby, the
    check ends as not possible. A robot without a plan resource gets poses straight ahead.
    """
    here = robot.map_pose() or Pose(0.0, 0.0, 0.0)
    reach = min(distance, robot.statement.motion.radius_m) if robot.statement.motion.arena is None else distance
    goals = reachable(robot, here, reach, count)
    if not goals:
        goals = [here.ahead(reach)]
        _, _, exchange = ask(robot, goals[0])
        if HTTPStatus.BAD_REQUEST <= exchange.response.status < HTTPStatus.INTERNAL_SERVER_ERROR:
            raise NoOccasionError("the robot has no plan to any pose around it")
    for part in range(1, count):
        if len(goals) < count:
            goals.append(_on_the_way(robot, here, goals[0], 1 - part / (count + 1)) or _turn(goals[0], part))
    return goals


def _on_the_way(robot: Robot, here: Pose, goal: Pose, share: float) -> Pose | None:
    """Return the pose at a share of the straight line to a goal, where the robot has a plan to that pose."""
    x, y = (one + share * (other - one) for one, other in zip(here[:2], goal[:2], strict=True))
    pose = Pose(x, y, goal.yaw)
    _, plan, _ = ask(robot, pose)
    return pose if plan is not None and plan.poses[-1].distance(pose) < EXACT else None


def _turn(goal: Pose, by_rad: float) -> Pose:
    """Return the goal's position with another heading, which is as reachable."""
    return Pose(goal.x, goal.y, math.remainder(goal.yaw + by_rad, math.tau))


def in_turn(goals: Sequence[Pose], number: int) -> Pose:
    """Return one goal of a series that takes turns between some places, each time with another heading."""
    return _turn(goals[number % len(goals)], number * _TURN_RAD)


def meanwhile(robot: Robot, id_: str, act: Callable[[dict[str, Any], Pose, dict[str, Any]], bool]) -> bool:
    """Run ``act`` while a new, distant goal is active.

    Where responses are slow a goal may end before all requests about it are sent, so that a check uses several goals.

    Args:
        robot: the robot; another active goal is replaced.
        id_: the goal's id, to which a number is added.
        act: called with the goal, its pose and another goal under its id; returns whether the goal was still active.

    Returns:
        Whether ``act`` ran while the goal was active, in one of a few tries.
    """
    frame = robot.statement.motion.frame
    for number in range(_ATTEMPTS):
        try:
            pose, other = choose_goals(robot, _FARTHEST_M, 2)
        except NoOccasionError:
            return False  # verdicts so far remain
        body, against = (goal_body(one, frame, f"{id_} {number}") for one in (pose, other))
        if not put_goal(robot, body).response.ok:
            return False  # another check judges that
        if act(body, pose, against):
            return True
    return False


def make_room(robot: Robot, ahead_m: float = _FAR_M) -> None:
    """Drive a robot that stands close to an obstacle to a place from which it can drive freely.

    A simulated robot's wheels turn on against a wall, and its pose then contradicts its velocity. Where the robot knows
    no such place or does not get there, it stays, and the checks judge what follows.

    Args:
        robot: a robot at rest.
        ahead_m: how far checks will drive it ahead or back, m; sideways they need only a few decimetres.
    """
    here = robot.map_pose()
    far = _FAR_M if robot.reverses else _ONE_WAY * _FAR_M
    if here is None or _is_open(robot, here, min(max(ahead_m, _NEAR_M), _FAR_M) if robot.reverses else far):
        return
    for distance in _DISTANCES_M:
        for pose in reachable(robot, here, distance, _PLACES):
            if _is_open(robot, pose, far):
                exchange = put_goal(robot, goal_body(pose, robot.statement.motion.frame))
                if exchange.response.ok:
                    await_none(robot, _ARRIVES_S)
                    robot.delete_goal()
                    await_none(robot)
                return


def _is_open(robot: Robot, pose: Pose, ahead_m: float) -> bool:
    """Return whether the robot has straight plans from a pose in all directions, ``ahead_m`` long ahead and back."""
    # In a circle, a robot moves aside by twice its radius.
    aside = max(_NEAR_M, _CIRCLE * (robot.statement.motion.min_radius_m or 0.0))
    around = [pose.ahead(aside, math.radians(angle)) for angle in range(60, 360, 60)]
    for there in (pose.ahead(ahead_m), pose.ahead(-ahead_m), *around):
        _, plan, _ = ask(robot, there, pose)
        if plan is None or plan.length > 1.2 * pose.distance(there) + 0.1 or not robot.in_arena(there):
            return False
    return True
