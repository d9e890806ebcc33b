"""/robot/velocity/ and /robot/velocity/linear/."""

from geometry_msgs.msg import Twist, Vector3

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.representation.shapes import shape_of
from reference_robot.webservices.resources.resource import Resource, represented, sent, wanted_format
from reference_robot.webservices.robot.velocity import Velocity as RobotVelocity


class Velocity(Resource):
    """The measured velocity, geometry_msgs/Twist; PUT sets a new one."""

    path = "/robot/velocity/"

    def __init__(self, velocity: RobotVelocity) -> None:
        self._velocity = velocity

    def get(self, request: Request) -> Response:
        """Return what the robot measures; 503 before the first odometry."""
        return represented(self._velocity.measured(), "Twist", wanted_format(request))

    async def put(self, request: Request) -> Response:
        """Set all six components; 200 with the accepted Twist."""
        media_type = wanted_format(request)
        twist = sent(request, shape_of(Twist))
        await self._velocity.command(twist)
        return represented(twist, "Twist", media_type)


class LinearVelocity(Resource):
    """The linear part, geometry_msgs/Vector3; PUT leaves the angular part as it was."""

    path = "/robot/velocity/linear/"

    def __init__(self, velocity: RobotVelocity) -> None:
        self._velocity = velocity

    def get(self, request: Request) -> Response:
        """Return what the robot measures; 503 before the first odometry."""
        return represented(self._velocity.measured()["linear"], "Vector3", wanted_format(request))

    async def put(self, request: Request) -> Response:
        """Set the three linear components; 200 with the accepted Vector3."""
        media_type = wanted_format(request)
        linear = sent(request, shape_of(Vector3))
        await self._velocity.command_linear(linear)
        return represented(linear, "Vector3", media_type)
