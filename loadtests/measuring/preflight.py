"""One call of every kind before the run: does the robot respond, and do both interfaces carry the same?"""

import json
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import gevent.socket
import requests
from lxml import etree

from conformance.documents.xml import parse
from conformance.papers_robot.delivery import COORDINATES, XSD_FIELDS
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import UNREACHABLE, CallError, connect_error
from loadtests.clients.library import LibraryRest, LibrarySoap, Sent, new_session, read_document
from loadtests.clients.payloads import CATALOGUE, NAMESPACE, Values, variants
from loadtests.clients.robot import Robot
from loadtests.clients.wire import Answer, Request, now_ns
from loadtests.schedule.plan import QUICK_ANSWER_S, SeriesName

#: Leaves of nav_msgs/Odometry that both interfaces' responses must contain, equally often.
_ODOMETRY = ("frame_id", "child_frame_id", "x", "y", "z", "w", "covariance", "sec")


def request_difference(operation: str, rest: Request, soap: Request) -> str | None:
    """Return how two requests, read back from their bytes, differ; None if they are equivalent.

    Doubles are compared bit for bit, each read back from its own text.
    """
    if CATALOGUE[operation].code is None:
        return None
    parts = rest.octets.split(b" ", 2)[1].decode().rsplit("/robot/app/delivery/", 1)[1].split("/")
    over_rest = {field: float(parts[2 * index + 2]) for index, field in enumerate(COORDINATES)}
    over_rest["message_code"] = int(parts[0])
    argument = parse(soap.octets.split(b"\r\n\r\n", 1)[1]).find(".//arg0")
    if argument is None:
        return "the SOAP request carries no arg0"
    over_soap = {child.tag: float(child.text or "nan") for child in argument}
    for name in XSD_FIELDS:
        if not _same_double(over_rest[name], over_soap.get(name, float("nan"))):
            return f"{name} is {over_rest[name]!r} over REST and {over_soap.get(name)!r} over SOAP"
    return None


def requests_difference(operation: str, rest: Sequence[Request], soap: Sequence[Request]) -> str | None:
    """Return the first variant in which the two interfaces' requests differ; None if none does."""
    if not rest or not soap:
        return None
    for number, (over_rest, over_soap) in enumerate(zip(rest, soap, strict=True)):
        difference = request_difference(operation, over_rest, over_soap)
        if difference:
            return f"{operation}, variant {number}: {difference}"
    return None


def pose_difference(rest: bytes, soap: bytes) -> str | None:
    """Return how two poses differ, or None if both are complete Odometry messages.

    A shorter message would have an advantage in the comparison.
    """
    try:
        over_rest = Counter(_json_leaves(json.loads(rest)))
        found = parse(soap).find(f".//{{{NAMESPACE}}}GetPoseResponse")
    except ValueError as error:
        return f"pose: a response cannot be read: {error}"
    over_soap = Counter(_xml_leaves(found)) if found is not None else Counter()
    for leaf in _ODOMETRY:
        if over_rest[leaf] != over_soap[leaf]:
            return f"pose: {over_rest[leaf]} values of {leaf!r} over REST and {over_soap[leaf]} over SOAP"
    return None


def values_difference(rest: bytes, soap: bytes) -> str | None:
    """Return how many values two responses have if not equally many; None if they have, or if one cannot be counted."""
    try:
        over_rest = sum(1 for _ in _json_leaves(json.loads(rest)))
        body = parse(soap).find("{*}Body")
    except ValueError:
        return None
    leaves = () if body is None else (each for each in body.iter() if isinstance(each.tag, str))
    over_soap = sum(len(each.attrib) + (0 if len(each) else _values_in(each.text or "")) for each in leaves)
    return None if over_rest == over_soap else f"{over_rest} values over REST and {over_soap} over SOAP"


def _values_in(text: str) -> int:
    """Return how many values a text is: numbers in a row are a list (xs:list), anything else is one."""
    words = text.split()
    try:
        return len([float(word) for word in words])
    except ValueError:
        return 1


def deliveries_missing(listed: list[Any], operation: str, sent: Values) -> list[str]:
    """Return the deliveries that were sent and are missing from the robot's list of accepted requests."""
    return [
        f"{operation}: the robot does not list the request that was sent over {interface}"
        for interface in ("rest", "soap")
        if not any(
            isinstance(entry, dict) and entry.get("interface") == interface and _is_request(entry.get("request"), sent)
            for entry in listed
        )
    ]


def _json_leaves(value: Any, name: str = "") -> Iterator[str]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _json_leaves(inner, key)
    elif isinstance(value, list):
        for inner in value:
            yield from _json_leaves(inner, name)
    else:
        yield name


def _xml_leaves(element: Any) -> Iterator[str]:
    name = etree.QName(element).localname
    children = [child for child in element if isinstance(child.tag, str)]
    if not children:
        words = (element.text or "").split() if name == "covariance" else [""]
        yield from [name] * max(1, len(words))
    for child in children:
        # An array may be a repeated element, or items inside one: either way its items bear its name.
        inner = list(_xml_leaves(child))
        yield from [name if name == "covariance" else leaf for leaf in inner]


def _is_request(listed: Any, sent: Values) -> bool:
    try:
        return all(_same_double(float(listed[field]), sent[field]) for field in XSD_FIELDS)
    except (KeyError, TypeError, ValueError):
        return False


def _same_double(one: float, other: float) -> bool:
    return struct.pack("<d", one) == struct.pack("<d", other)


# If the first read took up to _BY_CHANCE times as long as with a fast robot, that may be chance: read _READS times.
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
