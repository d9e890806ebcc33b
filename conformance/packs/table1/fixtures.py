"""pytest fixtures of every run on the paper's robot: clock, ROS probe, robot, and reads between the checks.

A fault that comes only after a certain kind of request is found only if somebody reads the state after each kind.
"""

import random
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from itertools import cycle
from typing import Final

import pytest

from conformance.api.interfaces import Interfaces
from conformance.api.rest.calls import XML
from conformance.api.rest.interface import RestInterface
from conformance.contract.classes import Interface
from conformance.observe.clock import WALL_CLOCK
from conformance.packs.table1.plugin import Device
from conformance.packs.table1.robot.clock import Clock
from conformance.packs.table1.robot.deliveries_seen import read_awaited
from conformance.packs.table1.robot.delivery_sender import DeliverySender
from conformance.packs.table1.robot.geometry import Pose, pose_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, read_as
from conformance.packs.table1.robot.motion_map import motion_map_of, xml_root_of
from conformance.packs.table1.robot.plan import query
from conformance.packs.table1.robot.probe import RosProbe
from conformance.packs.table1.robot.refused_requests import RefusedRequests
from conformance.packs.table1.robot.robot import (
    ACCEPT_JSON,
    DELIVERIES,
    GOAL_PATH,
    LINEAR,
    PLAN,
    POSE,
    SENSORS,
    SERVICES,
    VELOCITY,
    Robot,
)
from conformance.packs.table1.robot.soap_services import ask
from conformance.packs.table1.robot.stopping import await_rest
from conformance.packs.table1.statement import said_of
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.scenario import NotPossibleError
from conformance.scenarios.stage import Stage
from conformance.transport.client import Connection
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run

# At quick effort, one beat after this many checks.
_EVERY: Final = 2
# An odd reading is repeated after this time, s, because one interface may lag.
_AGAIN_S: Final = 0.3
# Distance from the robot's first place to the goals of plans, m.
_AWAY_M: Final = 0.5
#: What each beat reads, as JSON or XML paths and SOAP operations.
_BEATS: Final = (
    (GOAL_PATH, "GetGoal", GOAL_PATH),
    (GOAL_PATH, f"{XML} {GOAL_PATH}", GOAL_PATH),
    (VELOCITY, "GetVelocity", VELOCITY),
    (VELOCITY, f"{XML} {VELOCITY}", VELOCITY, LINEAR),
    (POSE, "GetPose", POSE),
    (POSE, f"{XML} {POSE}", POSE),
    (POSE, PLAN, POSE),
    (POSE, "GetPlan", POSE),
    (f"{PLAN}?start",),
    (SENSORS, "GetSensors", SENSORS),
    (SERVICES, "GetNavigationServices", SERVICES),
    (f"{XML} {DELIVERIES}", DELIVERIES),
)
_GONE: Final = frozenset({403, 404, 405, 501})


class Beats:
    """Reads the state after each check, in an order that follows from the run's seed."""

    def __init__(self, api: RestInterface, interfaces: Interfaces) -> None:
        run = api.run
        self._rest, self._run = api.client, run
        self._doubting = api.device.doubting if isinstance(api.device, Device) else ()
        self._soap = interfaces.soap.subscribers
        if "soap-subscribers" not in run.claims or Interface.SUBSCRIBERS in run.unreachable:
            self._soap = None
        beats = [beat for beat in _BEATS if all(map(self._is_claimed, beat))]
        random.Random(f"{run.seed}/beats").shuffle(beats)  # noqa: S311 - no secret
        self._beats = cycle(beats)
        self._count, self._sent = 0, api.client.connection.sent
        self._gone: set[str] = set()
        frame = said_of(run).motion.frame
        self._frame: dict[str, str] = {} if frame == "map" else {"frame_id": frame}
        # Goals of plans, and starts of some, in the frame of goals.
        self._places: tuple[Pose, Pose] | None = None

    def _is_claimed(self, what: str) -> bool:
        if what.startswith("Get"):
            return self._soap is not None
        path = what.removeprefix(f"{XML} ").partition("?")[0]
        claimed = {"rest-resources", "rest-delivery" if path == DELIVERIES else "rest-resources"}
        claimed |= {"rest-formats"} if what.startswith(XML) else set()
        return claimed <= set(self._run.claims)

    def beat(self) -> None:
        """Read a little, if a request was sent since the last time; more if the last reading was odd.

        Raises:
            NoAnswerError: no HTTP response came.
        """
        connection, effort = self._rest.connection, self._run.effort
        if connection.sent == self._sent or connection.request_rate or effort.slow:
            return
        self._count += 1
        if effort.name != "quick" or self._count % _EVERY == 0:
            beat, acted = next(self._beats, ()), connection.acted_at
            self._read(beat)
            if any(one.suspects for one in self._doubting):
                WALL_CLOCK.sleep(_AGAIN_S)
                self._read((*beat, VELOCITY))
            connection.acted_at = acted  # a beat only reads, so nobody has to wait for its effects
        self._sent = connection.sent

    def _read(self, beat: tuple[str, ...]) -> None:
        for what in beat:
            if what not in self._gone and self._send(what) in _GONE and what.split(" ")[-1] != GOAL_PATH:
                self._gone.add(what)

    def _send(self, what: str) -> int:
        """Send one request; return the status of its response, or 0."""
        there = None if self._places is None else {"x": self._places[0].x, "y": self._places[0].y}
        if what.startswith("Get"):
            if self._soap is not None and (what != "GetPlan" or there):
                parameters: dict[str, float | str] = {**there, **self._frame} if what == "GetPlan" and there else {}
                ask(self._soap, what, **parameters)
            return 0
        path, fields = what.removeprefix(f"{XML} "), (("Accept", XML),) if what.startswith(XML) else ACCEPT_JSON
        if path.startswith(PLAN):
            if self._places is None or there is None:
                return 0
            start = self._places[1]
            given = {"start_x": start.x, "start_y": start.y} if path != PLAN else {}
            path = query(**there, **given, **self._frame)
        if self._rest.refusal("GET", path):
            return 0
        exchange = self._rest.send("GET", path, headers=fields)
        if path == POSE and self._places is None:
            message, problem = read_as(exchange.response, ODOMETRY)
            if not problem:
                here = pose_of(message["pose"]["pose"]).seen_from(Pose(*said_of(self._run).motion.odom_to_map))
                self._places = here.ahead(_AWAY_M), here
        return exchange.response.status


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
