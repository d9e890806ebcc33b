"""One simulated user, with its connections and clients, that sends requests and records their outcome."""

import re
from typing import Any

import gevent

from loadtests.clients.failures import CallError
from loadtests.clients.library import LibraryRest, LibrarySoap, Sent
from loadtests.clients.payloads import INTERFACES, Values
from loadtests.clients.robot import Robot
from loadtests.clients.rosbridge import Bridge
from loadtests.clients.wire import Connection, Request, now_ns

_DURATION = re.compile(rb"([\w-]+)\s*;[^,]*?dur\s*=\s*\"?([0-9.]+)")


def server_ns(timing: bytes | None) -> int:
    """Return the time that a robot reports for its own work (Server-Timing, W3C), in ns; -1 without such a header.

    The metric called `total` counts if there is one, else the longest: metrics may overlap, so they are not added.
    """
    if not timing:
        return -1
    found = {name.lower(): float(value) for name, value in _DURATION.findall(timing) if value.count(b".") <= 1}
    if not found:
        return -1
    return int(found.get(b"total", max(found.values())) * 1e6)


class Workload:
    """The data that all users of a process share: requests built beforehand, values, parsed WSDLs.

    Args:
        operations: names, in the order in which arrivals number them.
        documents: parsed WSDLs by operation, for zeep.
        sent: counts the requests that the library clients send.
    """

    def __init__(
        self, robot: Robot, operations: tuple[str, ...], seed: int, documents: dict[str, Any], sent: Sent | None = None
    ) -> None:
        self.sent = sent or Sent()
        self.robot = robot
        self.operations = operations
        self.documents = documents
        self.values: list[list[Values]] = [robot.values(name, seed) for name in operations]
        self.requests: dict[str, list[list[Request]]] = {
            interface: [robot.requests(interface, name, seed) for name in operations] for interface in INTERFACES
        }
        self.bridge = robot.bridge()  # one for all users


class Caller:
    """One user. Connections are opened at the first request and kept."""

    def __init__(self, workload: Workload, recorder: Any) -> None:
        self.workload = workload
        self.recorder = recorder
        self._wires: dict[tuple[str, int], Connection | Bridge] = {}
        self._rest: LibraryRest | None = None
        self._soap: LibrarySoap | None = None

    def _wire(self, interface: str, operation: int) -> Connection | Bridge:
        """Return the connection for an operation; operations of one origin share it, as in any HTTP client."""
        known = self._wires.get((interface, operation))
        if known is None:
            known = self.workload.bridge if interface == "rosbridge" else self._http(interface, operation)
            self._wires[interface, operation] = known
        return known

    def _http(self, interface: str, operation: int) -> Connection:
        fresh = self.workload.robot.http(interface, self.workload.operations[operation])
        for (other, _), connection in self._wires.items():
            if (
                other == interface
                and isinstance(connection, Connection)
                and connection.endpoint.origin == fresh.endpoint.origin
            ):
                return connection
        return fresh

    def perform(
        self, segment: int, interface: str, client: str, operation: int, payload: int, due: int, *, noticed: int = 0
    ) -> bool:
        """Send a request and record its outcome; returns whether it succeeded.

        `due` and `noticed` are when it was to start, and when the pacer saw that no user was free (monotonic ns).
        """
        recorder = self.recorder
        start = now_ns()
        try:
            if client == "wire":
                connection = self._wires.get((interface, operation)) or self._wire(interface, operation)
                request = self.workload.requests[interface][operation][payload]
                connects = connection.connects
                built = now_ns()
                answer = connection.call(request)
                answer.require_good(request.expects)
                done = now_ns()
                received, timing = answer.received_ns, answer.headers.get(b"server-timing")
                if connection.connects != connects:
                    recorder.count("connects")
            else:
                timed = self._library(interface, operation, payload)
                done = now_ns()
                built, received, timing = timed.built_ns, timed.received_ns, timed.timing
        except CallError as error:
            recorder.failed(segment, operation, error, due, start)
            return False
        recorder.record(segment, operation, due, start, built, received, done, server_ns(timing), noticed=noticed)
        return True

    def _library(self, interface: str, operation: int, payload: int) -> Any:
        workload = self.workload
        name, values = workload.operations[operation], workload.values[operation][payload]
        try:
            with gevent.Timeout(workload.robot.timeout_s):  # requests has no deadline for a body that drips
                if interface == "rest":
                    if self._rest is None:
                        self._rest = LibraryRest(workload.robot, workload.sent)
                    return self._rest.call(name, values)
                if self._soap is None:
                    self._soap = LibrarySoap(workload.robot, workload.documents, workload.sent)
                return self._soap.call(name, values)
        except gevent.Timeout:
            raise CallError("timeout", f"no complete response within {workload.robot.timeout_s:g} s") from None

    def close(self) -> None:
        """Close all connections; the next calls open new ones."""
        for connection in self._wires.values():
            connection.close()
        for library in (self._rest, self._soap):
            if library is not None:
                library.close()
