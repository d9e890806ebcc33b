"""/robot/navigation/: the active goal, which clients read, send and cancel; and a path to a pose in the query."""

import math
import re
from typing import Any, Final
from urllib.parse import unquote_to_bytes

from reference_robot.webservices.http.hosts import Address
from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.representation.problems import Problem, shown
from reference_robot.webservices.representation.reading import NUMBER
from reference_robot.webservices.resources.resource import NO_CONTENT, Resource, represented, sent, wanted_format
from reference_robot.webservices.robot.goals import GOAL, Goals
from reference_robot.webservices.robot.plans import Planner, PlanQuery

_CREATED: Final = 201


class Goal(Resource):
    """The active goal as a move_base_msgs/MoveBaseActionGoal, with a status that the robot adds."""

    path = "/robot/navigation/action/goal/"

    def __init__(self, goals: Goals, address: Address) -> None:
        self._goals = goals
        self._location = address.location(self.path)

    def get(self, request: Request) -> Response:
        """Return the active goal; raise the Problem 404 if there is none."""
        media_type = wanted_format(request)
        return represented(self._goals.followed(), GOAL.name, media_type)

    async def put(self, request: Request) -> Response:
        """Send a goal to the navigation; return 201 for a new goal, 202 if it displaces another, 200 for a repeat."""
        media_type = wanted_format(request)
        status, goal = await self._goals.send(sent(request, GOAL))
        location = ((b"location", self._location),) if status == _CREATED else ()
        return represented(goal, GOAL.name, media_type, status, location)

    async def delete(self, _request: Request) -> Response:
        """Cancel the active goal and return 204; raise the Problem 404 if there is none."""
        await self._goals.cancel()
        return NO_CONTENT


_NUMBER: Final = re.compile(NUMBER)
_REQUIRED: Final = ("x", "y")
_NUMBERS: Final = (*_REQUIRED, "yaw", "tolerance", "start_x", "start_y", "start_yaw")


class Plan(Resource):
    """The resource that returns a nav_msgs/GetPlan response for the pose in the query string."""

    path = "/robot/navigation/service/plan"

    def __init__(self, planner: Planner) -> None:
        self._planner = planner

    async def get(self, request: Request) -> Response:
        """Return a plan; raise the Problem 422 if no path leads to the pose."""
        media_type = wanted_format(request)
        return represented(await self._planner.plan(_query(request.query)), "GetPlan", media_type)


def _query(raw: bytes) -> PlanQuery:
    """Return the plan query from a raw query string; unknown parameters are ignored.

    A plus sign is not decoded as a space, because no parameter can contain a space.

    Raises:
        Problem: 400 for a repeated parameter, 422 for a missing parameter or a number that is invalid or not finite.
    """
    found: dict[str, str] = {}
    for part in raw.split(b"&"):
        name, _, value = (unquote_to_bytes(side).decode("utf-8", "replace") for side in part.partition(b"="))
        if name in found:
            raise Problem(400, f"the parameter {shown(name)} occurs more than once")
        found[name] = value
    given: dict[str, Any] = {name: _number(name, found[name]) for name in _NUMBERS if name in found}
    for name in _REQUIRED:
        if name not in given:
            raise Problem(422, f"missing parameter {name}")
    if "frame_id" in found:
        given["frame_id"] = found["frame_id"]
    return PlanQuery(**given)


def _number(name: str, text: str) -> float:
    number = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise Problem(422, f"the parameter {name} must be a finite number, not {shown(text)}")
    return number
