"""What the robot does and has: velocity, which clients command; pose, from its odometry; and lists of the ROS graph."""

from collections.abc import Callable
from functools import partial
from typing import Final

from geometry_msgs.msg import Twist, Vector3

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.representation.shapes import shape_of
from reference_robot.webservices.resources.resource import FORMATS, Resource, represented, sent, wanted_format
from reference_robot.webservices.robot.odometry import LatestOdometry
from reference_robot.webservices.robot.velocity import Velocity as RobotVelocity


class Velocity(Resource):
    """The measured velocity as a geometry_msgs/Twist; PUT commands a new velocity."""

    path = "/robot/velocity/"

    def __init__(self, velocity: RobotVelocity) -> None:
        self._velocity = velocity

    def get(self, request: Request) -> Response:
        """Return the measured velocity; raise the Problem 503 without current odometry."""
        return represented(self._velocity.measured(), "Twist", wanted_format(request))

    async def put(self, request: Request) -> Response:
        """Command all six components of the velocity; return 200 with the accepted Twist."""
        media_type = wanted_format(request)
        twist = sent(request, shape_of(Twist))
        await self._velocity.command(twist)
        return represented(twist, "Twist", media_type)


class LinearVelocity(Resource):
    """The linear part of the velocity as a geometry_msgs/Vector3; PUT keeps the commanded angular part."""

    path = "/robot/velocity/linear/"

    def __init__(self, velocity: RobotVelocity) -> None:
        self._velocity = velocity

    def get(self, request: Request) -> Response:
        """Return the measured linear velocity; raise the Problem 503 without current odometry."""
        return represented(self._velocity.measured()["linear"], "Vector3", wanted_format(request))

    async def put(self, request: Request) -> Response:
        """Command the three linear components of the velocity; return 200 with the accepted Vector3."""
        media_type = wanted_format(request)
        linear = sent(request, shape_of(Vector3))
        await self._velocity.command_linear(linear)
        return represented(linear, "Vector3", media_type)


_WRITERS: Final = {media_type: partial(represented, root="Odometry", media_type=media_type) for media_type in FORMATS}


class Pose(Resource):
    """The latest odometry as a complete nav_msgs/Odometry."""

    path = "/robot/pose/"

    def __init__(self, odometry: LatestOdometry) -> None:
        self._odometry = odometry

    def get(self, request: Request) -> Response:
        """Return the odometry; raise the Problem 503 before the first message."""
        return self._odometry.written(_WRITERS[wanted_format(request)])


class GraphList(Resource):
    """A list of topics or services that is read from the ROS graph for each request; ``root`` is its XML element."""

    def __init__(self, path: str, root: str, entries: Callable[[], list[dict[str, str]]]) -> None:
        self.path = path
        self._root = root
        self._entries = entries

    def get(self, request: Request) -> Response:
        """Return the list in the format that the client prefers."""
        return represented(self._entries(), self._root, wanted_format(request))
