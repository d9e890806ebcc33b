"""One call of every kind before the run: does the robot answer, and do both interfaces carry the same?"""

from __future__ import annotations

import json
import struct
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import requests
from lxml import etree

from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import UNREACHABLE, CallError, answer_error
from loadtests.clients.library import LibraryRest, LibrarySoap, new_session, read_document
from loadtests.clients.payloads import FIELDS, NAMESPACE, VARIANTS, differences, variants
from loadtests.clients.wire import Answer, Connection

if TYPE_CHECKING:
    from collections.abc import Iterator

    from loadtests.clients.robot import Robot
    from loadtests.schedule.plan import SeriesName

_PARSER = etree.XMLParser(resolve_entities=False, no_network=True)
#: Leaves of nav_msgs/Odometry that have to be in both interfaces' answers, in the same number.
_ODOMETRY = ("frame_id", "child_frame_id", "x", "y", "z", "w", "covariance", "sec")


@dataclass
class Findings:
    """What the calls before the run brought.

    Attributes:
        sizes: octets of request and response of each wire series.
        servers: Server header by interface.
        failures: what failed, by series.
        unequal: how the interfaces' payloads differ.
        notes: what could not be compared.
    """

    sizes: dict[SeriesName, tuple[int, int]] = field(default_factory=dict)
    servers: dict[str, str | None] = field(default_factory=dict)
    failures: dict[SeriesName, CallError] = field(default_factory=dict)
    unequal: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def unreachable(self) -> bool:
        """Somebody who should be called cannot be reached."""
        return any(failure.kind in UNREACHABLE for failure in self.failures.values())

    def messages(self) -> list[str]:
        """The failures in words, each once."""
        worded = [f"{name[0]} over {name[1]} ({name[2]}): {failure}" for name, failure in self.failures.items()]
        return list(dict.fromkeys(worded))


def preflight(robot: Robot, names: list[SeriesName], seed: int) -> Findings:
    """Call each series once; compare what the interfaces send and get."""
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
    for operation in dict.fromkeys(name[0] for name in names):
        _compare_requests(robot, operation, seed, findings)
    if ("pose", "rest") in answers and ("pose", "soap") in answers:
        _compare_poses(answers["pose", "rest"], answers["pose", "soap"], findings)
    for operation in ("delivery", "coffee"):
        if (operation, "rest") in answers and (operation, "soap") in answers:
            _compare_received(robot, operation, seed, findings)
    return findings


def _wire_call(robot: Robot, name: SeriesName, seed: int, findings: Findings) -> Answer:
    operation, interface, _ = name
    request = robot.requests(interface, operation, seed)[0]
    connection = Connection(Endpoint.parse(robot.address(interface, operation) or ""), robot.timeout_s, robot.tls)
    try:
        answer = connection.call(request)
    finally:
        connection.close()
    server = answer.headers.get(b"server")
    findings.servers[interface] = server.decode("latin-1") if server else None
    location = answer.headers.get(b"location")
    failure = answer_error(
        answer.status, location.decode("latin-1") if location else None, answer.body, request.expects
    )
    if failure is not None:
        raise failure
    findings.sizes[name] = (len(request.octets), answer.octets)
    return answer


def _library_call(robot: Robot, operation: str, interface: str, seed: int) -> None:
    values = variants(operation, seed)[0]
    if interface == "rest":
        LibraryRest(robot).call(operation, values)
        return
    location = robot.wsdl(operation) or ""
    try:
        document = read_document(location, robot)
        client = LibrarySoap(robot, {operation: document})
    except requests.RequestException as error:
        raise CallError("network", f"WSDL {location!r}: {error}") from None
    except CallError:
        raise
    except Exception as error:  # noqa: BLE001 -- zeep and lxml raise dozens of kinds on a wrong WSDL
        raise CallError("content", f"zeep cannot use the WSDL {location!r}: {type(error).__name__}: {error}") from None
    client.call(operation, values)


def _compare_requests(robot: Robot, operation: str, seed: int, findings: Findings) -> None:
    """Every variant, read back from the octets that will be sent."""
    rest, soap = (robot.requests(interface, operation, seed) for interface in ("rest", "soap"))
    if not rest or not soap:
        return
    for number in range(VARIANTS):
        difference = differences(operation, rest[number], soap[number])
        if difference:
            findings.unequal.append(f"{operation}, variant {number}: {difference}")
            return


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


def _compare_poses(rest: Answer, soap: Answer, findings: Findings) -> None:
    """Both answers have to carry a whole Odometry: a shorter answer would win the duel by leaving out."""
    try:
        over_rest = Counter(_json_leaves(json.loads(rest.body)))
        found = etree.fromstring(soap.body, _PARSER).find(f".//{{{NAMESPACE}}}GetPoseResponse")
    except (ValueError, etree.XMLSyntaxError) as error:
        findings.unequal.append(f"pose: an answer cannot be read: {error}")
        return
    over_soap = Counter(_xml_leaves(found)) if found is not None else Counter()
    for leaf in _ODOMETRY:
        if over_rest[leaf] != over_soap[leaf]:
            findings.unequal.append(
                f"pose: {over_rest[leaf]} values of {leaf!r} over REST and {over_soap[leaf]} over SOAP"
            )
            return


def _compare_received(robot: Robot, operation: str, seed: int, findings: Findings) -> None:
    """What the robot says it got over each interface, where it tells (GET /robot/app/delivery/, an extension)."""
    if robot.rest is None:
        return
    try:
        with new_session(robot) as session:
            answer = session.get(
                robot.rest.rstrip("/") + "/robot/app/delivery/",
                timeout=robot.timeout_s,
                headers={"Accept": "application/json"},
            )
        listed = answer.json() if answer.ok else None
    except (requests.RequestException, ValueError):
        listed = None
    if not isinstance(listed, list):
        findings.notes.append("the robot does not list the requests it accepted, so what arrived was not compared")
        return
    sent = variants(operation, seed)[0]
    for interface in ("rest", "soap"):
        matching = [
            entry
            for entry in listed
            if isinstance(entry, dict) and entry.get("interface") == interface and _same(entry.get("request"), sent)
        ]
        if not matching:
            findings.unequal.append(f"{operation}: the robot does not list the request that was sent over {interface}")


def _same(request: Any, sent: dict[str, float]) -> bool:
    try:
        return all(struct.pack("<d", float(request[field])) == struct.pack("<d", sent[field]) for field in FIELDS)
    except (KeyError, TypeError, ValueError):
        return False
