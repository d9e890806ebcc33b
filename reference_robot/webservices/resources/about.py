"""What the robot says of itself: its health, an extension of this robot, and the contract's descriptions with it.

The descriptions contain the address that the client used, or the robot's public URL.
"""

import json
from collections.abc import Callable
from typing import Any, Final

import yaml
from lxml import etree

from conformance.papers_robot.statement import CONTRACT_DIR
from reference_robot.webservices.http.messages import Request, Response, content
from reference_robot.webservices.representation.writing import JSON, TEXT, XML
from reference_robot.webservices.resources.resource import FORMATS, Resource, represent, wanted_format
from reference_robot.webservices.robot.health import Health as RobotHealth

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
