"""/robot/navigation/service/plan: a path to the pose in the query string."""

import math
import re
from typing import Any, Final
from urllib.parse import unquote_to_bytes

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.representation.checking import shown
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.representation.reading import NUMBER
from reference_robot.webservices.resources.resource import Resource, represented, wanted_format
from reference_robot.webservices.robot.plans import Planner, PlanQuery

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
