"""Where a robot may be sent."""

import math
from collections.abc import Callable
from http import HTTPStatus
from typing import Any, Final

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import await_none, goal_body, put_goal
from conformance.packs.table1.robot.plan import EXACT, ask, reachable
from conformance.packs.table1.robot.robot import Robot
from conformance.scenarios.scenario import NotPossibleError

# How far velocities may take a robot: aside, and straight ahead, m.
_NEAR_M: Final = 0.4
_FAR_M: Final = 0.7
_PLACES: Final = 8
# How far away open places are looked for: the nearest first, for the way there takes time.
_DISTANCES_M: Final = (0.3, 0.5, 0.8, 1.5, 2.5)
# How far away a goal is that has to last, where there is room, m; and how often it is tried to be in time.
_FARTHEST_M: Final = 1.5
_ATTEMPTS: Final = 3
# A robot that makes room is waited for so long, s.
_ARRIVES_S: Final = 10.0


def choose_goals(robot: Robot, distance: float, count: int) -> list[Pose]:
    """Return so many different poses about ``distance`` metres from the robot (nearer where the statement says so).

    Poses to which the robot has a plan, or that lie on the way to one. Ends the check that asks, as one that cannot be
    judged, where the robot has no plan to anywhere near; a robot that answers no such question is sent straight ahead.
    """
    here = robot.map_pose() or Pose(0.0, 0.0, 0.0)
    reach = min(distance, robot.statement.motion.radius_m) if robot.statement.motion.arena is None else distance
    goals = reachable(robot, here, reach, count)
    if not goals:
        goals = [here.ahead(reach)]
        _, _, exchange = ask(robot, goals[0])
        if HTTPStatus.BAD_REQUEST <= exchange.response.status < HTTPStatus.INTERNAL_SERVER_ERROR:
            raise NotPossibleError("the robot has no plan to any pose around it")
    for part in range(1, count):
        if len(goals) < count:
            goals.append(_on_the_way(robot, here, goals[0], 1 - part / (count + 1)) or _turned(goals[0], part))
    return goals


def _on_the_way(robot: Robot, here: Pose, goal: Pose, share: float) -> Pose | None:
    """Return the pose at a share of the straight way to a goal, where the robot has a plan to it."""
    x, y = (one + share * (other - one) for one, other in zip(here[:2], goal[:2], strict=True))
    pose = Pose(x, y, goal.yaw)
    _, plan, _ = ask(robot, pose)
    return pose if plan is not None and plan.poses[-1].distance(pose) < EXACT else None


def _turned(goal: Pose, part: int) -> Pose:
    """Return the place of a goal with another heading: another pose, and as reachable."""
    return Pose(goal.x, goal.y, math.remainder(goal.yaw + part, math.tau))


def meanwhile(robot: Robot, id_: str, act: Callable[[dict[str, Any], Pose, dict[str, Any]], bool]) -> bool:
    """Do at once what is to be done while a goal is active, with a goal of its own, which is far away.

    Where each answer takes long, a goal is over before all is done that clients do with one; not before the first.

    Args:
        robot: that may have another goal, which is displaced.
        id_: of the goal, with a number.
        act: what is done, with the goal, its pose, and another goal under its id; whether the goal was there till then.

    Returns:
        Whether that could be done; it is tried a few times.
    """
    frame = robot.statement.motion.frame
    for number in range(_ATTEMPTS):
        try:
            pose, other = choose_goals(robot, _FARTHEST_M, 2)
        except NotPossibleError:
            return False  # what was judged before stays judged
        body, against = (goal_body(one, frame, f"{id_} {number}") for one in (pose, other))
        if not put_goal(robot, body).response.ok:
            return False  # which is for others to judge
        if act(body, pose, against):
            return True
    return False


def make_room(robot: Robot, ahead_m: float = _FAR_M) -> None:
    """Drive a robot that stands close to something to where it can be driven about by its velocity.

    A simulated robot's wheels go on turning against a wall, and its pose then moves otherwise than its velocity says.
    Where the robot stays if it knows of no such place, or does not go there, is for the checks to find out.

    Args:
        robot: at rest.
        ahead_m: how far ahead or back it may get; more than a few decimetres aside is no check's affair.
    """
    here = robot.map_pose()
    if here is None or _is_open(robot, here, min(max(ahead_m, _NEAR_M), _FAR_M)):
        return
    for distance in _DISTANCES_M:
        for pose in reachable(robot, here, distance, _PLACES):
            if _is_open(robot, pose, _FAR_M):
                exchange = put_goal(robot, goal_body(pose, robot.statement.motion.frame))
                if exchange.response.ok:
                    await_none(robot, _ARRIVES_S)
                    robot.delete_goal()
                    await_none(robot)
                return


def _is_open(robot: Robot, pose: Pose, ahead_m: float) -> bool:
    """Return whether the robot knows plain ways from a pose into all directions, of another length ahead and back."""
    around = [pose.ahead(_NEAR_M, math.radians(angle)) for angle in range(60, 360, 60)]
    for there in (pose.ahead(ahead_m), pose.ahead(-ahead_m), *around):
        _, plan, _ = ask(robot, there, pose)
        if plan is None or plan.length > 1.2 * pose.distance(there) + 0.1 or not robot.in_arena(there):
            return False
    return True
