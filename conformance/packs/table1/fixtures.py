"""pytest fixtures of every run on the paper's robot: its clock, the ROS probe, and the robot itself."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import pytest

from conformance.api.interfaces import Interfaces
from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.plugin import Device
from conformance.packs.table1.robot.beats import Beats
from conformance.packs.table1.robot.clock import Clock
from conformance.packs.table1.robot.deliveries_seen import read_awaited
from conformance.packs.table1.robot.delivery_sender import DeliverySender
from conformance.packs.table1.robot.motion_map import motion_map_of, xml_root_of
from conformance.packs.table1.robot.probe import RosProbe
from conformance.packs.table1.robot.refused_requests import RefusedRequests
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.robot.stopping import await_rest
from conformance.packs.table1.statement import said_of
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.scenario import NotPossibleError
from conformance.scenarios.stage import Stage
from conformance.transport.client import Connection
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run


@pytest.fixture
def clock(api: RestInterface) -> Clock:
    """The robot's clock, read by the way in the whole of the run."""
    if not isinstance(api.device, Device):
        raise TypeError("the run judges another kind of device")
    return api.device.clock


@pytest.fixture(scope="session", autouse=True)
def probe(run: Run, connection: Connection) -> Iterator[RosProbe]:
    """The ROS probe, started before it is needed where a domain is given."""
    started = RosProbe(said_of(run).ros, connection.recorder)
    started.start()
    yield started
    started.close()


@pytest.fixture(scope="session")
def senders() -> list[DeliverySender]:
    """Return the senders of the run's deliveries: later scenarios record messages that come after their batches."""
    return []


@pytest.fixture(scope="session", autouse=True)
def _fetch_descriptions(run: Run, interfaces: Interfaces) -> None:
    """Fetch the robot's own descriptions, by which every SOAP response of the run is judged."""
    for service in interfaces.soap.there.values():
        if service.name not in run.unreachable:
            _ = service.description


@pytest.fixture(scope="session")
def _lists_read(run: Run, interfaces: Interfaces) -> list[Callable[..., None]]:
    """Return functions that read the list of deliveries while a checker waits for it; empty without REST."""
    api = interfaces.rest
    if api is None or not isinstance(api.device, Device) or not run.allow_motion:
        return []
    found = [partial(read_awaited, api.client, deliveries) for deliveries in api.device.delivery_checkers]
    for read in found:
        with suppress(NoAnswerError):
            read()  # entries before the first delivery are older ones
    return [*found]


@pytest.fixture
def read_deliveries(_lists_read: list[Callable[..., None]]) -> Callable[..., None]:
    """Return a function that reads the list of deliveries until every delivery has been looked for.

    Raises:
        NotPossibleError: there is no REST interface to read their list at.
    """
    if not _lists_read:
        raise NotPossibleError("there is no REST interface whose list shows the deliveries")
    return partial(_lists_read[0], to_the_last=True)


@pytest.fixture
def refused(api: RestInterface) -> RefusedRequests:
    """Return the store of requests that the robot refused in the run."""
    if not isinstance(api.device, Device):
        raise TypeError("the run judges another kind of device")
    return api.device.refusal_stores[0]


@pytest.fixture(scope="session")
def mapped_robot(interfaces: Interfaces) -> MappedDevice:
    """Return the robot as the generic suite drives it; at rest when a scenario first asks for it.

    Raises:
        NotPossibleError: the device has no REST interface.
    """
    api = interfaces.rest
    if api is None:
        raise NotPossibleError("the device has no REST interface")
    found = MappedDevice(api, motion_map_of(said_of(api.run), xml_root_of(Robot(api))), looks=False)
    api.stop_device = None  # the pack stops the robot by itself
    return found


@pytest.fixture(autouse=True)
def _looked_at(_lists_read: list[Callable[..., None]], _beats: list[Beats]) -> Iterator[None]:
    """Look after each check for deliveries that the robot has accepted, and more.

    Here nothing is between two requests whose responses are compared.
    """
    yield
    with suppress(NoAnswerError):  # the next check meets the same failure
        for read in _lists_read:
            read()
        for beats in _beats:
            beats.beat()


@pytest.fixture(scope="session")
def _beats(interfaces: Interfaces, _fetch_descriptions: None) -> list[Beats]:
    """Return the reader of the robot's state between checks; empty without a REST interface."""
    api = interfaces.rest
    return [Beats(api, interfaces)] if api is not None and isinstance(api.device, Device) else []


@pytest.fixture
def robot(request: pytest.FixtureRequest, api: RestInterface) -> Robot:
    """Return the robot; for a scenario that moves the robot, at rest.

    Raises:
        NotPossibleError: the robot cannot be brought to rest.
    """
    if request.node.get_closest_marker("motion"):
        phase = request.node.get_closest_marker("phase")
        await_rest(api, settled=phase is not None and phase.args == (Stage.STANDSTILL,))
    return Robot(api)
