"""The assembly of the web services: all resources and web methods share one pair of ROS nodes, as in the paper."""

from typing import Final, NamedTuple

from reference_robot.webservices.configuration import Configuration
from reference_robot.webservices.http.hosts import Address
from reference_robot.webservices.http.listening import REST, SOAP, Listening
from reference_robot.webservices.nodes.calls import ManagedNode, RosCalls
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.resources.delivery import Delivery, DeliveryList
from reference_robot.webservices.resources.description import OpenApi, Wadl
from reference_robot.webservices.resources.health import Health as HealthResource
from reference_robot.webservices.resources.navigation import Goal, Plan
from reference_robot.webservices.resources.state import GraphList, LinearVelocity, Pose
from reference_robot.webservices.resources.state import Velocity as VelocityResource
from reference_robot.webservices.rest import RestInterface
from reference_robot.webservices.robot.deliveries import Deliveries
from reference_robot.webservices.robot.goals import Goals
from reference_robot.webservices.robot.health import Health
from reference_robot.webservices.robot.odometry import LatestOdometry
from reference_robot.webservices.robot.plans import Planner
from reference_robot.webservices.robot.velocity import Velocity
from reference_robot.webservices.soap.interface import SoapInterface
from reference_robot.webservices.soap.publishers import PublishersWebService
from reference_robot.webservices.soap.subscribers import SubscribersWebService

_STATE_DEADLINE: Final = 1.0  # seconds for a managed node to report its state


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
