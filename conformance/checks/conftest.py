"""What goes along with every check: the observers, which judge each exchange whoever has it, and the ROS probe."""

import importlib
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Final

import pytest

from conformance.rest.interface import RestInterface
from conformance.rest.observers import Observer as RestObserver
from conformance.robot.clock import Clock
from conformance.robot.goal_observer import GoalObserver
from conformance.robot.interfaces import Interfaces
from conformance.robot.observer import Observer as RobotObserver
from conformance.robot.plan_observer import PlanObserver
from conformance.robot.probe.client import RosProbe
from conformance.robot.robot import Robot
from conformance.robot.standstill import Standstill
from conformance.robot.stopping import bring_to_rest
from conformance.soap.observer import PASSIVE, SoapObserver, answers_of
from conformance.soap.service import SoapService
from conformance.transport.client import Connection
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run

# What is imported late because few commands need it, and is needed later in a run.
_NEEDED_LATER: Final = ("conformance.soap.zeep_client", "schemathesis.specs.openapi", "jsonschema")


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
        connection.listeners.append(PlanObserver(interfaces.rest))
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


@pytest.fixture
def _prepared(interfaces: Interfaces) -> Iterator[None]:
    """For a check that mostly waits for the robot: meanwhile is imported and compiled what later ones need."""
    services = tuple(interfaces.soap.there.values())
    for service in services:
        _ = service.own  # for which the robot may have to be asked: here, and not at any moment of the drive
    thread = threading.Thread(target=_prepare, args=(services,), name="preparing")
    thread.start()
    yield
    thread.join()


def _prepare(services: Iterable[SoapService]) -> None:
    # What does not work here does not where it is needed, and is told there.
    with suppress(Exception):
        for service in services:
            _ = service.described.types, service.contract.types
        for module in _NEEDED_LATER:
            importlib.import_module(module)


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


@pytest.fixture(autouse=True)
def _looked_at(_standstills: list[Standstill]) -> Iterator[None]:
    """Behind a check that only reads: the robot stays at rest, where it was tried to move it just before."""
    yield
    for one in _standstills:
        with suppress(NoAnswerError):  # whoever asks next finds that out as well, and judges it
            one.look()


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
