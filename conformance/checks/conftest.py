"""What goes along with every check: the observers, which judge each exchange whoever has it, and the ROS probe."""

from collections.abc import Iterator

import pytest

from conformance.rest.interface import RestInterface
from conformance.rest.observers import Observer as RestObserver
from conformance.robot.clock import Clock
from conformance.robot.goal_observer import GoalObserver
from conformance.robot.interfaces import Interfaces
from conformance.robot.observer import Observer as RobotObserver
from conformance.robot.probe.client import RosProbe
from conformance.robot.robot import Robot
from conformance.robot.standstill import Standstill
from conformance.robot.stopping import bring_to_rest
from conformance.soap.observer import PASSIVE, SoapObserver, answers_of
from conformance.transport.client import Connection
from conformance.verdict.run import Run


@pytest.fixture(scope="session")
def clock() -> Clock:
    """The robot's clock, read by the way in the whole of the run."""
    return Clock()


@pytest.fixture(scope="session", autouse=True)
def _watched(run: Run, interfaces: Interfaces, connection: Connection, clock: Clock) -> None:
    """Have every exchange judged from the first check on. Here, and nowhere else, observers are registered."""
    services = interfaces.soap.there.values()
    if interfaces.rest is not None:
        connection.listeners.append(RestObserver(interfaces.rest, [service.endpoint for service in services]))
        connection.listeners.append(RobotObserver(interfaces.rest, clock))
        connection.listeners.append(GoalObserver(interfaces.rest))
    if services and not run.contract.ledger.keys().isdisjoint(PASSIVE):
        answers = {service.endpoint: answers_of(service) for service in services}
        connection.listeners.append(SoapObserver(run.judge, answers))


@pytest.fixture(scope="session", autouse=True)
def probe(run: Run) -> Iterator[RosProbe]:
    """The ROS probe, started before it is needed where a domain is given."""
    started = RosProbe(run.statement.ros)
    started.start()
    yield started
    started.close()


@pytest.fixture(scope="session")
def _standstills() -> list[Standstill]:
    """The one of the run, once it is known that the robot has a REST interface."""
    return []


@pytest.fixture
def standstill(api: RestInterface, _standstills: list[Standstill]) -> Standstill:
    """What was tried and has to leave the robot at rest."""
    if not _standstills:
        _standstills.append(Standstill(api))
    return _standstills[0]


@pytest.fixture
def robot(request: pytest.FixtureRequest, api: RestInterface, standstill: Standstill) -> Robot:
    """The robot; at rest for a check that moves it."""
    if not request.node.get_closest_marker("motion") or standstill.lasts:
        return Robot(api)
    standstill.judge()
    reason = bring_to_rest(api)
    if reason:
        pytest.skip(reason)
    return Robot(api)
