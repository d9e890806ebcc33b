"""The REST interface, and the assembly of the web services.

All resources and web methods share one pair of ROS nodes, as in the paper.
"""

from collections.abc import Awaitable, Callable, Iterable
from typing import Final, NamedTuple

from reference_robot.webservices.configuration import Configuration
from reference_robot.webservices.http.access import Admission, Scope
from reference_robot.webservices.http.hosts import Address
from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.listening import REST, SOAP, Listening
from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.nodes.calls import ManagedNode, RosCalls
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.resources.resource import Resource
from reference_robot.webservices.resources.robot import (
    Delivery,
    DeliveryList,
    Goal,
    GraphList,
    LinearVelocity,
    OpenApi,
    Plan,
    Pose,
    Wadl,
)
from reference_robot.webservices.resources.robot import Health as HealthResource
from reference_robot.webservices.resources.robot import Velocity as VelocityResource
from reference_robot.webservices.robot.deliveries import Deliveries
from reference_robot.webservices.robot.goals import Goals
from reference_robot.webservices.robot.health import Health
from reference_robot.webservices.robot.odometry import LatestOdometry
from reference_robot.webservices.robot.plans import Planner
from reference_robot.webservices.robot.velocity import Velocity
from reference_robot.webservices.soap.service import SoapInterface
from reference_robot.webservices.soap.subscribers import PublishersWebService, SubscribersWebService

Handlers = dict[str, Callable[[Request], Response | Awaitable[Response]]]

_DELIVERY_PATHS: Final = b"/robot/app/delivery/"
_STATE_DEADLINE: Final = 1.0  # seconds for a managed node to report its state


class RestInterface(Interface):
    """The REST interface: resources with fixed paths, and the delivery resource, whose path contains values."""

    def __init__(self, resources: Iterable[Resource], delivery: Delivery, admission: Admission) -> None:
        super().__init__(admission)
        self._fixed: dict[bytes, Handlers] = {resource.path.encode(): resource.handlers() for resource in resources}
        self._delivery = delivery

    def scope(self, request: Request) -> Scope:
        """Return the scope for a request that changes something: ``deliver`` for deliveries, otherwise ``move``."""
        return Scope.DELIVER if request.path.startswith(_DELIVERY_PATHS) else Scope.MOVE

    def answer(self, request: Request) -> Response | Awaitable[Response]:
        """Return the response of the resource that the request addresses.

        Raises:
            Problem: 404 for an unknown path whatever the method, 405 with Allow for a method that the resource does not
                offer (RFC 9110 15.5.5, 15.5.6), and every problem that the resource raises.
        """
        handlers = self._fixed.get(request.path)
        if handlers is None:
            if request.method == "PUT" and request.path.startswith(_DELIVERY_PATHS):
                return self._delivery.put(request)  # must be fast; refuses an invalid path
            handlers = self._with_values(request.path)
        handler = handlers.get(request.method)
        if handler is not None:
            return handler(request)
        allow = (b"allow", ", ".join([*handlers, "OPTIONS"]).encode())
        if request.method == "OPTIONS":
            return Response(204, (allow,))
        raise Problem(405, f"the method is not one of {allow[1].decode()}", (allow,))

    def _with_values(self, path: bytes) -> Handlers:
        if self._delivery.owns(path):
            return self._delivery.handlers()
        hint = "; its path ends with a slash" if path + b"/" in self._fixed else ""
        raise Problem(404, f"there is no resource at {path.decode('ascii')[:200]!a}{hint}")


class Endpoints(NamedTuple):
    """The base URLs of the REST and SOAP interfaces, with the ports that were bound."""

    rest: str
    soap: str


def interfaces(
    publishers: RobotPublishersNode,
    subscribers: RobotSubscribersNode,
    configuration: Configuration,
    endpoints: Endpoints,
    listening: Listening,
) -> tuple[RestInterface, SoapInterface, Velocity]:
    """Return the REST interface, the SOAP interface and the Velocity object that both use.

    Close the Velocity object after the interfaces have stopped, so that the robot stops.
    """
    frames = configuration.frames
    executor, nodes = publishers.node.executor, configuration.nodes
    calls = RosCalls(executor, configuration.web.deadline)
    quick_calls = RosCalls(executor, min(_STATE_DEADLINE, configuration.web.deadline))
    navigator, planner_node = (
        ManagedNode(subscribers.node, quick_calls, name) for name in (nodes.navigator, nodes.planner)
    )
    goals = Goals(publishers, subscribers, calls, navigator, frames)
    odometry = LatestOdometry(subscribers)
    velocity = Velocity(publishers, odometry, configuration.web, goals.is_active)
    planner = Planner(subscribers, calls, planner_node, odometry, frames)
    deliveries = Deliveries(publishers, subscribers)
    rest_address = Address(endpoints.rest, listening.public_urls.get(REST))
    soap_address = Address(endpoints.soap, listening.public_urls.get(SOAP))
    admission = listening.admission()
    resources = [
        Pose(odometry),
        VelocityResource(velocity),
        LinearVelocity(velocity),
        GraphList("/robot/sensors/", "Sensors", subscribers.sensors),
        GraphList("/robot/navigation/services/", "NavigationServices", subscribers.navigation_services),
        Goal(goals, rest_address),
        HealthResource(Health(publishers, subscribers, odometry, navigator, planner_node)),
        Plan(planner),
        DeliveryList(deliveries),
        OpenApi(rest_address),
        Wadl(rest_address),
    ]
    services = [
        PublishersWebService(deliveries),
        SubscribersWebService(subscribers, odometry, velocity, goals, planner),
    ]
    rest = RestInterface(resources, Delivery(deliveries), admission)
    soap = SoapInterface(services, soap_address, admission)
    rest.lag = soap.lag = configuration.web.lag
    return rest, soap, velocity
