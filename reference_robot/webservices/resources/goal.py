"""/robot/navigation/action/goal/: the active navigation goal, which clients read, send and cancel."""

from typing import Final

from reference_robot.webservices.http.address import Address
from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.resources.resource import NO_CONTENT, Resource, represented, sent, wanted_format
from reference_robot.webservices.robot.goals import GOAL, Goals

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
