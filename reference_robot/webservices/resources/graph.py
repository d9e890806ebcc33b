"""/robot/sensors/ and /robot/navigation/services/: what is on the robot's graph."""

from typing import ClassVar

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.resources.resource import Resource, represented, wanted_format


class Sensors(Resource):
    """Name, topic and type of every sensor."""

    path: ClassVar = "/robot/sensors/"

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers

    def get(self, request: Request) -> Response:
        """Return the list."""
        return represented(self._subscribers.sensors(), "Sensors", wanted_format(request))


class NavigationServices(Resource):
    """Name and type of every service of the navigation stack."""

    path: ClassVar = "/robot/navigation/services/"

    def __init__(self, subscribers: RobotSubscribersNode) -> None:
        self._subscribers = subscribers

    def get(self, request: Request) -> Response:
        """Return the list."""
        services = self._subscribers.navigation_services()
        return represented(services, "NavigationServices", wanted_format(request))
