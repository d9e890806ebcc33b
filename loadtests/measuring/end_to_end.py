"""Measure the time from a request to the message in the application, which an operator waits for, and not for the 204.

Deliveries are sent one at a time over every way, in rounds in random order, and a probe in the application's place
reports when each arrived. The probe shares the generator's clock: both run on one machine, wherever the robot is. The
baseline is publishing with rclpy, without any web service.
"""

import json
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field

import gevent
import numpy as np

from conformance.papers_robot.delivery import COURIER, EXAMPLE, MESSAGE_FIELDS
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import CallError
from loadtests.clients.payloads import BUILDERS, Values
from loadtests.clients.robot import Robot
from loadtests.clients.rosbridge import Bridge, bridge_requests
from loadtests.clients.wire import Connection, Request, now_ns
from loadtests.settings.settings import EndToEnd
from ros_probe.process import RosProcess, SilentError


class Probe(RosProcess):
    """A process on the ROS graph, in the role `listen` or `publish`; call `await_ready` first."""

    def __init__(self, role: str, domain_id: int, topic: str) -> None:
        super().__init__(role, "--delivery-topic", topic, domain_id=domain_id)

    def publish(self, values: tuple[float, ...]) -> int:
        """Publish a delivery; returns when that began (CLOCK_MONOTONIC, ns).

        Raises:
            ProbeError: it has ended.
        """
        return int(self.ask(json.dumps([float(value).hex() for value in values]))["sent_ns"])

    def arrival_ns(self, values: tuple[float, ...], within_s: float) -> int | None:
        """Return the time at which a listener received a delivery with these values; None if it does not come in time.

        Raises:
            ProbeError: the probe's process has ended.
        """
        wanted = [float(value).hex() for value in values]
        until = time.monotonic() + within_s
        with suppress(SilentError):
            while True:
                ((at_ns, *heard),) = self.told(max(0.0, until - time.monotonic()))["deliveries"]
                if heard == wanted:
                    return int(at_ns)
        return None


#: A delivery that has not arrived by then is lost.
LOST_S = 2.0
#: The way without a web service.
NATIVE = "ros"
_DELIVERY = "delivery"
_NS = 1_000_000_000
_WARMING = 5  # rounds that open connections, and are not counted
_FEWEST = 20  # rounds, however long they take
_MOST_RATE = 50.0  # deliveries per second


@dataclass
class Journeys:
    """The times of deliveries over one way, by round.

    Attributes:
        to_application_ns: from the request's start to the message in the application; None: the message never came.
        answer_ns: from the request's start to its response; None: this way has no response.
        errors: number of requests without a good response.
    """

    to_application_ns: list[int | None] = field(default_factory=list)
    answer_ns: list[int | None] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


class Courier:
    """Sends deliveries, one at a time, over each way."""

    def __init__(self, robot: Robot, ways: tuple[str, ...], publisher: Probe) -> None:
        self._robot = robot
        self._publisher = publisher
        self._connections: dict[str, Connection | Bridge] = {
            way: robot.bridge() if way == "rosbridge" else robot.http(way, _DELIVERY) for way in ways if way != NATIVE
        }

    def send(self, way: str, values: Values) -> tuple[int, int | None]:
        """Send a delivery; returns when that began, and when its response was received.

        Raises:
            CallError: there is no good response.
            ProbeError: the publisher has ended.
        """
        if way == NATIVE:
            return self._publisher.publish(in_order(values)), None
        request = self._request(way, values)
        began = now_ns()
        answer = self._connections[way].call(request)
        answer.require_good(request.expects)
        return began, answer.received_ns

    def _request(self, way: str, values: Values) -> Request:
        if way == "rosbridge":
            return bridge_requests([values], self._robot.delivery_topic)[0]
        endpoint = Endpoint.parse(self._robot.address(way, _DELIVERY) or "")
        return BUILDERS[way](endpoint, _DELIVERY, values, self._robot.token)

    def close(self) -> None:
        """Close the connections."""
        for connection in self._connections.values():
            connection.close()


def in_order(values: Values) -> tuple[float, ...]:
    """Return a delivery's values in the order of the ROS message."""
    return tuple(float(values[name]) for name in MESSAGE_FIELDS)


def end_to_end(
    robot: Robot,
    settings: EndToEnd,
    ways: tuple[str, ...],
    seed: int,
    stopped: Callable[[], bool],
    tell: Callable[[str], None],
) -> dict[str, Journeys]:
    """Measure every way, publishing with rclpy included; returns their journeys.

    Raises:
        ProbeError: this machine has no ROS, or the domain has no publisher of deliveries.
    """
    with ExitStack() as stack:
        listener = Probe("listen", settings.domain_id, robot.delivery_topic)
        stack.callback(listener.close)
        listener.await_ready()  # before our own publisher exists, which it would take for the robot's
        publisher = Probe("publish", settings.domain_id, robot.delivery_topic)
        stack.callback(publisher.close)
        publisher.await_ready()
        courier = Courier(robot, ways, publisher)
        stack.callback(courier.close)
        return _rounds(courier, listener, (*ways, NATIVE), settings, seed, stopped, tell)


def _rounds(
    courier: Courier,
    listener: Probe,
    ways: tuple[str, ...],
    settings: EndToEnd,
    seed: int,
    stopped: Callable[[], bool],
    tell: Callable[[str], None],
) -> dict[str, Journeys]:
    rng = np.random.default_rng([seed, 8])
    found = {way: Journeys() for way in ways}
    pause_s = 1 / min(_MOST_RATE, settings.most_rate or _MOST_RATE)
    began_ns = told_ns = now_ns()
    for number in range(_WARMING + settings.rounds):
        for way in rng.permutation(ways).tolist():
            if stopped() or (number > _WARMING + _FEWEST and now_ns() - began_ns > settings.longest_s * _NS):
                return found
            values = {name: value + float(rng.uniform(-5, 5)) for name, value in EXAMPLE.items()}
            _journey(courier, listener, way, values | {"message_code": COURIER}, found[way])
            gevent.sleep(pause_s)
        if number == _WARMING - 1:  # connections are open and DDS has matched by now
            found = {way: Journeys() for way in ways}
        if now_ns() - told_ns > _NS:
            told_ns = now_ns()
            tell(f"end to end: round {max(0, number + 1 - _WARMING)} of {settings.rounds}")
    return found


def _journey(courier: Courier, listener: Probe, way: str, values: Values, journeys: Journeys) -> None:
    try:
        began, answered = courier.send(way, values)
    except CallError as error:
        journeys.errors.append(str(error))
        journeys.to_application_ns.append(None)
        journeys.answer_ns.append(None)
        return
    arrived = listener.arrival_ns(in_order(values), LOST_S)
    journeys.to_application_ns.append(None if arrived is None else arrived - began)
    journeys.answer_ns.append(None if answered is None else answered - began)
