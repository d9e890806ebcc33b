"""The resources below /robot/, as the paper's table lists them: what a request asks of the robot, and what is returned.

Clients command the velocity, send and cancel a goal, ask for a path, and request deliveries. They read the pose and the
lists of the ROS graph.

The descriptions contain the address that the client used, or the robot's public URL.
"""

import json
import math
import re
from collections.abc import Callable
from functools import partial
from typing import Any, Final
from urllib.parse import unquote_to_bytes

import yaml
from geometry_msgs.msg import Twist, Vector3
from lxml import etree

from conformance.papers_robot.delivery import PATH_NAMES
from conformance.papers_robot.statement import CONTRACT_DIR
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.http.hosts import Address
from reference_robot.webservices.http.messages import Request, Response, content
from reference_robot.webservices.representation.problems import Problem, clip
from reference_robot.webservices.representation.reading import NUMBER
from reference_robot.webservices.representation.shapes import shape_of
from reference_robot.webservices.representation.writing import JSON, TEXT, XML
from reference_robot.webservices.resources.resource import (
    FORMATS,
    NO_CONTENT,
    Resource,
    body_of,
    represent,
    wanted_format,
)
from reference_robot.webservices.robot.deliveries import Deliveries, UnusableFieldError
from reference_robot.webservices.robot.goals import GOAL, Goals
from reference_robot.webservices.robot.health import Health as RobotHealth
from reference_robot.webservices.robot.odometry import LatestOdometry
from reference_robot.webservices.robot.plans import Planner, PlanQuery
from reference_robot.webservices.robot.velocity import Velocity as RobotVelocity

_PART: Final = {
    "type": "object",
    "required": ["available"],
    "properties": {
        "available": {"type": "boolean"},
        "age": {"type": "number", "minimum": 0, "description": "Seconds since the last message."},
        "silence": {"type": "number", "minimum": 0, "description": "Seconds since the ROS threads were last active."},
        "state": {"type": "string", "description": "State of the managed node, or unmanaged, silent, unknown."},
        "by": {"type": "string", "enum": ["service", "action"]},
    },
}
_PARTS: Final = ("ros", "odometry", "velocity", "navigation", "planner", "localisation", "delivery")
_SCHEMA: Final = {
    "type": "object",
    "required": ["healthy", *_PARTS],
    "properties": {"healthy": {"type": "boolean"}} | dict.fromkeys(_PARTS, _PART),
    "xml": {"name": "Health"},
}


class Health(Resource):
    """The robot's health; the status is 200 even if the robot is unhealthy."""

    path = "/robot/health/"
    # The entry for this path in the OpenAPI description.
    described: Final[dict[str, Any]] = {
        "get": {
            "operationId": "getHealth",
            "tags": ["extension"],
            "summary": "The available parts of the robot, and the age of their data",
            "description": "An extension of this robot; not in the contract.",
            "responses": {
                "200": {
                    "description": "An object for each part, and healthy for the whole robot.",
                    "content": {
                        JSON: {"schema": _SCHEMA},
                        XML: {"schema": _SCHEMA},
                        TEXT: {"schema": {"type": "string"}},
                    },
                },
                "401": {"$ref": "#/components/responses/Problem"},
                "406": {"$ref": "#/components/responses/Problem"},
            },
        }
    }

    def __init__(self, health: RobotHealth) -> None:
        self._health = health

    async def get(self, request: Request) -> Response:
        """Return the health report in the format that the client prefers."""
        media_type = wanted_format(request)
        return represent(await self._health.report(), "Health", media_type)


_WADL_NAMESPACE: Final = "{http://wadl.dev.java.net/2009/02}"


class OpenApi(Resource):
    """The OpenAPI description as JSON."""

    path = "/openapi.json"

    def __init__(self, address: Callable[[Request], str]) -> None:
        self._address = address
        document: Any = yaml.safe_load((CONTRACT_DIR / "openapi.yaml").read_text(encoding="utf-8"))
        self._document: dict[str, Any] = document | {"paths": document["paths"] | {Health.path: Health.described}}

    def get(self, request: Request) -> Response:
        """Return the OpenAPI description with this robot's URL as the server."""
        document = self._document | {"servers": [{"url": self._address(request)}]}
        return content(200, "application/json", json.dumps(document, default=str).encode())


class Wadl(Resource):
    """The WADL description of the REST interface."""

    path = "/application.wadl"

    def __init__(self, address: Callable[[Request], str]) -> None:
        self._address = address
        self._document = etree.parse(CONTRACT_DIR / "robot.wadl")
        for resources in self._document.iter(f"{_WADL_NAMESPACE}resources"):
            resources.append(_health())

    def get(self, request: Request) -> Response:
        """Return the WADL description with this robot's URL as the base."""
        for resources in self._document.iter(f"{_WADL_NAMESPACE}resources"):
            resources.set("base", self._address(request) + "/")
        body = etree.tostring(self._document, encoding="utf-8", xml_declaration=True)
        return content(200, "application/vnd.sun.wadl+xml", body)


def _health() -> etree._Element:
    resource = etree.Element(f"{_WADL_NAMESPACE}resource", path=Health.path.removeprefix("/"))
    method = etree.SubElement(resource, f"{_WADL_NAMESPACE}method", name="GET", id="getHealth")
    response = etree.SubElement(method, f"{_WADL_NAMESPACE}response", status="200")
    for media_type in FORMATS:
        etree.SubElement(response, f"{_WADL_NAMESPACE}representation", mediaType=media_type)
    return resource


_ODOMETRY_WRITERS: Final = {
    media_type: partial(represent, root="Odometry", media_type=media_type) for media_type in FORMATS
}
_CREATED: Final = 201
_NUMBER: Final = re.compile(NUMBER)
_PLAN_NEEDS: Final = ("x", "y")
_PLAN_NUMBERS: Final = (*_PLAN_NEEDS, "yaw", "tolerance", "start_x", "start_y", "start_yaw")
# The path template's names of the values, in the order of the message's fields.
_DELIVERY_NAMES: Final = ("code", *PATH_NAMES)
_DELIVERIES: Final = "/robot/app/delivery/"
_ANY_DELIVERY: Final = re.compile(
    (f"{_DELIVERIES}([^/]*)" + "".join(f"/{name}/([^/]*)" for name in PATH_NAMES)).encode()
)
_WELL_FORMED_DELIVERY: Final = re.compile(
    (f"{_DELIVERIES}([+-]?[0-9]{{1,40}})" + "".join(f"/{name}/({NUMBER})" for name in PATH_NAMES)).encode()
)
_CODE: Final = re.compile(rb"[+-]?[0-9]{1,40}")
_COORDINATE: Final = re.compile(NUMBER.encode())


class Velocity(Resource):
    """The measured velocity as a geometry_msgs/Twist; PUT commands a new velocity."""

    path = "/robot/velocity/"

    def __init__(self, velocity: RobotVelocity) -> None:
        self._velocity = velocity

    def get(self, request: Request) -> Response:
        """Return the measured velocity; raise the Problem 503 without current odometry."""
        return represent(self._velocity.read(), "Twist", wanted_format(request))

    async def put(self, request: Request) -> Response:
        """Command all six components of the velocity; return 200 with the accepted Twist."""
        media_type = wanted_format(request)
        twist = body_of(request, shape_of(Twist))
        await self._velocity.command(twist)
        return represent(twist, "Twist", media_type)


class LinearVelocity(Resource):
    """The linear part of the velocity as a geometry_msgs/Vector3; PUT keeps the commanded angular part."""

    path = "/robot/velocity/linear/"

    def __init__(self, velocity: RobotVelocity) -> None:
        self._velocity = velocity

    def get(self, request: Request) -> Response:
        """Return the measured linear velocity; raise the Problem 503 without current odometry."""
        return represent(self._velocity.read()["linear"], "Vector3", wanted_format(request))

    async def put(self, request: Request) -> Response:
        """Command the three linear components of the velocity; return 200 with the accepted Vector3."""
        media_type = wanted_format(request)
        linear = body_of(request, shape_of(Vector3))
        await self._velocity.command_linear(linear)
        return represent(linear, "Vector3", media_type)


class Pose(Resource):
    """The latest odometry as a complete nav_msgs/Odometry."""

    path = "/robot/pose/"

    def __init__(self, odometry: LatestOdometry) -> None:
        self._odometry = odometry

    def get(self, request: Request) -> Response:
        """Return the odometry; raise the Problem 503 before the first message."""
        return self._odometry.write_latest(_ODOMETRY_WRITERS[wanted_format(request)])


class GraphList(Resource):
    """A list of topics or services that is read from the ROS graph for each request; ``root`` is its XML element."""

    def __init__(self, path: str, root: str, entries: Callable[[], list[dict[str, str]]]) -> None:
        self.path = path
        self._root = root
        self._entries = entries

    def get(self, request: Request) -> Response:
        """Return the list in the format that the client prefers."""
        return represent(self._entries(), self._root, wanted_format(request))


class Goal(Resource):
    """The active goal as a move_base_msgs/MoveBaseActionGoal, with a status that the robot adds."""

    path = "/robot/navigation/action/goal/"

    def __init__(self, goals: Goals, address: Address) -> None:
        self._goals = goals
        self._location = address.location(self.path)

    def get(self, request: Request) -> Response:
        """Return the active goal; raise the Problem 404 if there is none."""
        media_type = wanted_format(request)
        return represent(self._goals.active_goal(), GOAL.name, media_type)

    async def put(self, request: Request) -> Response:
        """Send a goal to the navigation; return 201 for a new goal, 202 if it displaces another, 200 for a repeat."""
        media_type = wanted_format(request)
        status, goal = await self._goals.send(body_of(request, GOAL))
        location = ((b"location", self._location),) if status == _CREATED else ()
        return represent(goal, GOAL.name, media_type, status, location)

    async def delete(self, _request: Request) -> Response:
        """Cancel the active goal and return 204; raise the Problem 404 if there is none."""
        await self._goals.cancel()
        return NO_CONTENT


class Plan(Resource):
    """The resource that returns a nav_msgs/GetPlan response for the pose in the query string."""

    path = "/robot/navigation/service/plan"

    def __init__(self, planner: Planner) -> None:
        self._planner = planner

    async def get(self, request: Request) -> Response:
        """Return a plan; raise the Problem 422 if no path leads to the pose."""
        media_type = wanted_format(request)
        return represent(await self._planner.plan(_query(request.query)), "GetPlan", media_type)


def _query(raw: bytes) -> PlanQuery:
    """Return the plan query from a raw query string; unknown parameters are ignored.

    A plus sign is not decoded as a space, because no parameter can contain a space.

    Raises:
        Problem: 400 for a repeated parameter, 422 for a missing parameter or a number that is invalid or not finite.
    """
    found: dict[str, str] = {}
    for part in raw.split(b"&"):
        name, _, value = (unquote_to_bytes(side).decode("utf-8", "replace") for side in part.partition(b"="))
        if name in found:
            raise Problem(400, f"the parameter {clip(name)} occurs more than once")
        found[name] = value
    given: dict[str, Any] = {name: _number(name, found[name]) for name in _PLAN_NUMBERS if name in found}
    for name in _PLAN_NEEDS:
        if name not in given:
            raise Problem(422, f"missing parameter {name}")
    if "frame_id" in found:
        given["frame_id"] = found["frame_id"]
    return PlanQuery(**given)


def _number(name: str, text: str) -> float:
    number = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise Problem(422, f"the parameter {name} must be a finite number, not {clip(text)}")
    return number


class Delivery(Resource):
    """The resource whose PUT publishes one DeliveryRequestMsg; its path contains the message's values."""

    path = _DELIVERIES + "{code}" + "".join(f"/{name}/{{{name}}}" for name in PATH_NAMES)

    def __init__(self, deliveries: Deliveries) -> None:
        self._deliveries = deliveries

    @staticmethod
    def owns(path: bytes) -> bool:
        """Return whether a raw URL path has the form of a delivery path, whatever its values."""
        return _ANY_DELIVERY.fullmatch(path) is not None

    def put(self, request: Request) -> Response:
        """Publish a delivery and return 204; raise the Problem 422 for an unknown code or an invalid number."""
        match = _WELL_FORMED_DELIVERY.fullmatch(request.path)
        sent = _spelled_out(request.path) if match is None else match.groups()
        try:
            self._deliveries.accept(DeliveryRequest(int(sent[0]), *map(float, sent[1:])), "rest")
        except UnusableFieldError as error:
            place = DeliveryRequest._fields.index(error.field)
            raise error.refusal(_DELIVERY_NAMES[place], _text(sent[place])) from error
        return NO_CONTENT


class DeliveryList(Resource):
    """The resource that lists the latest accepted deliveries with their states: an extension of the contract."""

    path = _DELIVERIES

    def __init__(self, deliveries: Deliveries) -> None:
        self._deliveries = deliveries

    def get(self, request: Request) -> Response:
        """Return the list of deliveries, newest first."""
        return represent(self._deliveries.latest(), "Deliveries", wanted_format(request))


def _spelled_out(path: bytes) -> tuple[bytes, ...]:
    """Return the percent-decoded values of a delivery path; raise the Problem 422 that names an invalid value."""
    match = _ANY_DELIVERY.fullmatch(path)
    if match is None:
        raise Problem(404, "there is no resource at this delivery path")
    code, *coordinates = values = tuple(unquote_to_bytes(group) for group in match.groups())
    if not _CODE.fullmatch(code):
        raise Problem(422, f"code must be an integer, not {clip(_text(code))}")
    for name, value in zip(PATH_NAMES, coordinates, strict=True):
        if not _COORDINATE.fullmatch(value):
            raise Problem(422, f"{name} must be a number, not {clip(_text(value))}")
    return values


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")
