"""/robot/pose/: the robot's pose."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from nav_msgs.msg import Odometry

from reference_robot.webservices.representation.messages import reader_of
from reference_robot.webservices.representation.problems import not_yet
from reference_robot.webservices.resources.resource import Resource, represented, wanted_format

if TYPE_CHECKING:
    from reference_robot.webservices.http.messages import Request, Response
    from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode


class Pose(Resource):
    """The odometry received last, nav_msgs/Odometry in full.

    Each message is written at most once in each format, however often it is asked for.
    """

    path: ClassVar = "/robot/pose/"

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers
        self._read = reader_of(Odometry)
        self._written_from: Any = None
        self._written: dict[str, Response] = {}

    def get(self, request: Request) -> Response:
        """Return the odometry; 503 before the first."""
        media_type = wanted_format(request)
        message = self._subscribers.odometry
        if message is not self._written_from:
            self._written, self._written_from = {}, message
        response = self._written.get(media_type)
        if response is None:
            response = represented(self.plain(), "Odometry", media_type)
            self._written[media_type] = response
        return response

    def plain(self) -> dict[str, Any]:
        """Return the odometry received last as plain data; 503 where there is none, or it is not finite."""
        message = self._subscribers.odometry
        if message is None:
            raise not_yet("the robot has not published its odometry yet")
        return self._read(message)
