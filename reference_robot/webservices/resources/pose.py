"""/robot/pose/: the robot's pose."""

from functools import partial
from typing import Final

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.resources.resource import FORMATS, Resource, represented, wanted_format
from reference_robot.webservices.robot.odometry import LatestOdometry

_WRITERS: Final = {media_type: partial(represented, root="Odometry", media_type=media_type) for media_type in FORMATS}


class Pose(Resource):
    """The odometry received last, nav_msgs/Odometry in full."""

    path = "/robot/pose/"

    def __init__(self, odometry: LatestOdometry) -> None:
        self._odometry = odometry

    def get(self, request: Request) -> Response:
        """Return the odometry; 503 before the first."""
        return self._odometry.written(_WRITERS[wanted_format(request)])
