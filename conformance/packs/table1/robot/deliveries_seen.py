"""Observe arriving deliveries: by a ROS probe on the robot's graph, or by the robot's own list."""

from typing import Any, Final, Protocol

from conformance.api.rest.interface import RestInterface
from conformance.observe.clock import WALL_CLOCK, Clock, Patience, poll, poll_for
from conformance.packs.table1.checkers.deliveries import Deliveries
from conformance.packs.table1.robot.delivery import Delivery, Seen
from conformance.packs.table1.robot.message_shapes import DELIVERIES as LIST
from conformance.packs.table1.robot.message_shapes import read_as
from conformance.packs.table1.robot.probe import ARRIVES_S, Probe, ProbeError, RosProbe
from conformance.packs.table1.robot.robot import ACCEPT_JSON, DELIVERIES
from conformance.packs.table1.statement import said_of
from conformance.transport.client import Connection, HttpClient

QUIET_S: Final = 0.15  # how long the suite waits for another message after the last one, s
_STEP_S: Final = 0.02  # pause between two looks, s
# Pause between two reads of the list while a delivery is awaited, s.
_AGAIN_S: Final = 0.1


class DeliveryObserver(Protocol):
    """Sees deliveries.

    Attributes:
        exact: whether even the sign of a zero is seen, which JSON may lose.
    """

    exact: bool

    def mark(self) -> None:
        """Forget the deliveries seen so far."""

    def collect(self, count: int, then_s: float = QUIET_S) -> list[Seen]:
        """Return the deliveries seen since the mark or the last call, oldest first.

        Waits for ``count`` of them, and then for so much longer, s.
        """


class NoObserverError(Exception):
    """Raised when no observer can see arriving deliveries; the message explains why."""


class ListObserver:
    """The robot's own list."""

    exact = False

    def __init__(self, rest: HttpClient, slow_s: float, clock: Clock = WALL_CLOCK) -> None:
        self._rest, self._slow_s, self._clock = rest, slow_s, clock
        self._before: list[Any] = []

    def mark(self) -> None:
        """Forget the entries that the list has now."""
        self._before = self._read_list()

    def collect(self, count: int, then_s: float = QUIET_S) -> list[Seen]:
        """Return the new entries of the list."""
        patience = Patience(self._rest.connection.pace, ARRIVES_S + 4 * self._slow_s, self._clock)
        for _ in poll(self._clock, _STEP_S, lambda: patience.over):
            listed = self._read_list()
            if len(self._new(listed)) >= count:
                break
        if then_s:
            self._clock.sleep(then_s)
            listed = self._read_list()
        new = self._new(listed)
        self._before = listed
        return [Seen(Delivery.of(entry["request"]), entry["interface"]) for entry in reversed(new)]

    def _new(self, listed: list[Any]) -> list[Any]:
        """Return the new entries of the list, newest first: those before the first old one."""
        now, old = [_identity(entry) for entry in listed], [_identity(entry) for entry in self._before]
        for count in range(len(now)):
            rest = now[count:]
            if rest == old[: len(rest)]:
                return listed[:count]
        return listed

    def _read_list(self) -> list[Any]:
        value, problem = read_as(self._rest.send("GET", DELIVERIES, headers=ACCEPT_JSON).response, LIST)
        if problem:
            raise NoObserverError(f"the robot's list of deliveries cannot be read: {problem}")
        entries: list[Any] = value
        return entries


def _identity(entry: Any) -> tuple[Any, ...]:
    """Return the part of an entry that stays the same: its state changes."""
    accepted = entry["accepted"]
    return (Delivery.of(entry["request"]).bits, accepted["sec"], accepted["nanosec"], entry["interface"])


class ProbeObserver:
    """A ROS node on the robot's graph.

    Args:
        probe: its process.
        connection: knows when a request was sent that might be a delivery.
        clock: by which the node is read.
    """

    exact = True

    def __init__(self, probe: Probe, connection: Connection, clock: Clock = WALL_CLOCK) -> None:
        self._probe, self._connection, self._clock = probe, connection, clock

    def mark(self) -> None:
        """Forget the messages received so far."""
        # A message caused by a request since the last collect() may still be on its way.
        if self._connection.acted_at > self._probe.heard_at:
            self._clock.sleep(self._connection.acted_at + QUIET_S - self._clock.now())
            self._probe.heard_at = self._clock.now()
        self._probe.deliveries()

    def collect(self, count: int, then_s: float = QUIET_S) -> list[Seen]:
        """Return the new messages."""
        seen: list[Delivery] = []
        for _ in poll_for(self._clock, _STEP_S, ARRIVES_S):
            seen += self._probe.deliveries()
            if len(seen) >= count:
                break
        if then_s:
            self._clock.sleep(then_s)
            seen += self._probe.deliveries()
        if then_s >= QUIET_S:
            self._probe.heard_at = self._clock.now()
        return [Seen(delivery) for delivery in seen]


def observer_of(api: RestInterface, probe: RosProbe) -> DeliveryObserver:
    """Return the ROS probe if there is one, otherwise the robot's own list.

    Raises:
        NoObserverError: it has none.
    """
    reason = "no ROS domain is given (--ros-domain-id)"
    if said_of(api.run).ros.domain_id is not None:
        try:
            return ProbeObserver(probe.ready(), api.client.connection)
        except ProbeError as error:
            reason = f"the ROS probe does not work: {error}"
    exchange = api.client.send("GET", DELIVERIES, headers=ACCEPT_JSON)
    if not exchange.response.ok:
        raise NoObserverError(f"{reason}, and the robot has no list of deliveries ({exchange.came})")
    return ListObserver(api.client, api.run.effort.usual_ms / 1000)


def read_awaited(rest: HttpClient, deliveries: Deliveries, *, to_the_last: bool = False) -> None:
    """Read the robot's list if accepted deliveries await that, or until none does.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    until = WALL_CLOCK.now() + ARRIVES_S
    while deliveries.awaits(WALL_CLOCK.now()) or (to_the_last and deliveries.is_waiting):
        deliveries.has_list = rest.send("GET", DELIVERIES, headers=ACCEPT_JSON).response.ok
        if not to_the_last or WALL_CLOCK.now() > until:
            break
        WALL_CLOCK.sleep(_AGAIN_S)
