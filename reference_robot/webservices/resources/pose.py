"""/robot/pose/: the robot's pose and velocity from its odometry."""

from functools import partial
from typing import Final

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.resources.resource import FORMATS, Resource, represented, wanted_format
from reference_robot.webservices.robot.odometry import LatestOdometry

_WRITERS: Final = {media_type: partial(represented, root="Odometry", media_type=media_type) for media_type in FORMATS}


class Pose(Resource):
    """The latest odometry as a complete nav_msgs/Odometry."""

    path = "/robot/pose/"

    def __init__(self, odometry: LatestOdometry) -> None:
        self._odometry = odometry

    def get(self, request: Request) -> Response:
        """Return the odometry; raise the Problem 503 before the first message."""
        return self._odometry.written(_WRITERS[wanted_format(request)])
