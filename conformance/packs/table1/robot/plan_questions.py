"""Requests for plans to different places, whose responses can be told apart by where the path ends."""

from collections.abc import Callable

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.questions import Question
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.message_shapes import GET_PLAN, read_as
from conformance.packs.table1.robot.plan import plan_of, query, reachable
from conformance.packs.table1.robot.robot import Robot
from conformance.transport.exchange import Response

_PLACES = 4
_FAR_M = 1.0
# Places that are nearer to each other than this cannot be distinguished by where a plan ends, m.
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
        for other in [_ends_elsewhere(place, [one for one in places if one is not place])]
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
