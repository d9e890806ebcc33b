"""/robot/pose/: the robot's pose."""

from typing import Any

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.resources.resource import Resource, represented, wanted_format
from reference_robot.webservices.robot.odometry import LatestOdometry


class Pose(Resource):
    """The odometry received last, nav_msgs/Odometry in full.

    Each message is written at most once in each format, however often it is asked for.
    """

    path = "/robot/pose/"

    def __init__(self, odometry: LatestOdometry) -> None:
        self._odometry = odometry
        self._written_from: Any = None
        self._written: dict[str, Response] = {}

    def get(self, request: Request) -> Response:
        """Return the odometry; 503 before the first."""
        media_type = wanted_format(request)
        message = self._odometry.message()
        if message is not self._written_from:
            self._written, self._written_from = {}, message
        response = self._written.get(media_type)
        if response is None:
            response = represented(self._odometry.plain(), "Odometry", media_type)
            self._written[media_type] = response
        return response
