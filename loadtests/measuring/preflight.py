"""One call of every kind before the run: does the robot respond, and do both interfaces carry the same?"""

from dataclasses import dataclass, field
from typing import Any

import gevent.socket
import requests

from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import UNREACHABLE, CallError, connect_error
from loadtests.clients.library import LibraryRest, LibrarySoap, Sent, new_session, read_document
from loadtests.clients.payloads import CATALOGUE, variants
from loadtests.clients.robot import Robot
from loadtests.clients.wire import Answer, now_ns
from loadtests.measuring.equivalence import deliveries_missing, pose_difference, requests_difference, values_difference
from loadtests.schedule.plan import QUICK_ANSWER_S, SeriesName

# A slow first read, up to _BY_CHANCE times a quick robot's time, may be chance: read _READS times.
_READS, _BY_CHANCE = 3, 10


@dataclass
class Findings:
    """The results of the calls before the run.

    Attributes:
        sizes: bytes of request and response of each wire series.
        servers: Server header by interface.
        failures: what failed, by series.
        unequal: how the interfaces' payloads differ.
        notes: what could not be compared.
        slowest_s: the longest time that the wire client waited for a response. A read that may have been slow by
            chance is repeated: its shortest time counts.
    """

    sizes: dict[SeriesName, tuple[int, int]] = field(default_factory=dict)
    servers: dict[str, str | None] = field(default_factory=dict)
    failures: dict[SeriesName, CallError] = field(default_factory=dict)
    unequal: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    slowest_s: float = 0.0

    @property
    def unreachable(self) -> bool:
        """Return whether a service could not be reached."""
        return any(failure.kind in UNREACHABLE for failure in self.failures.values())

    def refusal_text(self, whose: str) -> str:
        """Return a sentence on the robot that refused the credentials of every request; empty if it did not."""
        statuses = {failure.refused for failure in self.failures.values()}
        if self.sizes or not statuses or 0 in statuses:
            return ""
        count = len(self.failures)
        said = f"The only request to {whose} was" if count == 1 else f"All {count} requests to {whose} were"
        return (
            f"{said} answered {' or '.join(map(str, sorted(statuses)))}: "
            "nothing was measured. Check that the credentials are given, are right and have not expired."
        )

    def messages(self) -> list[str]:
        """Return the failures as sentences, each once."""
        worded = [f"{name[0]} over {name[1]} ({name[2]}): {failure}" for name, failure in self.failures.items()]
        return list(dict.fromkeys(worded))


def preflight(robot: Robot, names: list[SeriesName], seed: int) -> Findings:
    """Call each series once, and compare the interfaces' requests and responses."""
    findings = Findings()
    answers: dict[tuple[str, str], Answer] = {}
    for name in names:
        operation, interface, client = name
        try:
            if client == "wire":
                answers[operation, interface] = _wire_call(robot, name, seed, findings)
            else:
                _library_call(robot, operation, interface, seed)
        except CallError as error:
            findings.failures[name] = error
            if error.kind in UNREACHABLE or error.kind == "timeout":
                break  # each further call would wait for the same deadline
    _compare(robot, answers, list(dict.fromkeys(name[0] for name in names)), seed, findings)
    return findings


def reach(robot: Robot) -> None:
    """Open a connection to a robot, and close it.

    Raises:
        CallError: nothing listens there.
    """
    endpoint = Endpoint.parse(robot.rest or "")
    try:
        gevent.socket.create_connection((endpoint.host, endpoint.port), robot.timeout_s).close()
    except OSError as error:
        raise connect_error(error, endpoint.url) from None


def _compare(
    robot: Robot, answers: dict[tuple[str, str], Answer], operations: list[str], seed: int, findings: Findings
) -> None:
    """Note how the requests and responses of the interfaces differ."""
    if robot.described:
        _compare_pairs(answers, operations, findings)
        return
    differences = [
        requests_difference(name, robot.requests("rest", name, seed), robot.requests("soap", name, seed))
        for name in operations
    ]
    answered = [name for name in operations if (name, "rest") in answers and (name, "soap") in answers]
    if "pose" in answered:
        differences.append(pose_difference(answers["pose", "rest"].body, answers["pose", "soap"].body))
    findings.unequal += [difference for difference in differences if difference]
    for operation in answered:
        if CATALOGUE[operation].code is None:
            continue
        listed = _listed_deliveries(robot)
        if listed is None:
            findings.notes.append(
                "the robot does not list the requests it accepted, so that their arrival was not checked"
            )
        else:
            findings.unequal += deliveries_missing(listed, operation, variants(operation, seed)[0])


def _compare_pairs(answers: dict[tuple[str, str], Answer], operations: list[str], findings: Findings) -> None:
    """Note which pairs of a described device's operations do not return equally many values: its vendor paired them."""
    for name in operations:
        rest, soap = (answers.get((name, interface)) for interface in ("rest", "soap"))
        difference = values_difference(rest.body, soap.body) if rest and soap else None
        if difference:
            findings.notes.append(f"{name} returns {difference}: the comparison includes that difference")


def _wire_call(robot: Robot, name: SeriesName, seed: int, findings: Findings) -> Answer:
    operation, interface, _ = name
    request = robot.requests(interface, operation, seed)[0]
    connection = robot.bridge() if interface == "rosbridge" else robot.http(interface, operation)
    waited = []
    try:
        for _ in range(_READS if request.octets.startswith(b"GET ") else 1):
            began = now_ns()
            answer = connection.call(request)
            server = answer.headers.get(b"server")
            findings.servers[interface] = server.decode("latin-1") if server else None
            answer.require_good(request.expects)
            waited.append((answer.received_ns - began) / 1e9)
            if not QUICK_ANSWER_S < waited[-1] < _BY_CHANCE * QUICK_ANSWER_S:
                break
    finally:
        connection.close()
    findings.slowest_s = max(findings.slowest_s, min(waited))
    findings.sizes[name] = (len(request.octets), answer.octets)
    return answer


def _library_call(robot: Robot, operation: str, interface: str, seed: int) -> None:
    values = variants(operation, seed)[0]
    if interface == "rest":
        LibraryRest(robot, Sent()).call(operation, values)
        return
    location = robot.wsdl(operation) or ""
    try:
        document = read_document(location, robot)
        client = LibrarySoap(robot, {operation: document}, Sent())
    except requests.RequestException as error:
        raise CallError("network", f"WSDL {location!r}: {error}") from None
    except CallError:
        raise
    except Exception as error:  # noqa: BLE001 -- zeep and lxml raise dozens of kinds on a wrong WSDL
        raise CallError("content", f"zeep cannot use the WSDL {location!r}: {type(error).__name__}: {error}") from None
    client.call(operation, values)


def _listed_deliveries(robot: Robot) -> list[Any] | None:
    """Return the robot's list of accepted deliveries (GET /robot/app/delivery/, an extension); None if it has none."""
    try:
        with new_session(robot) as session:
            answer = session.get(
                (robot.rest or "").rstrip("/") + "/robot/app/delivery/",
                timeout=robot.timeout_s,
                headers={"Accept": "application/json"},
            )
        listed = answer.json() if answer.ok else None
    except (requests.RequestException, ValueError):
        return None
    return listed if isinstance(listed, list) else None
