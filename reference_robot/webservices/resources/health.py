"""/robot/health/: which parts of the robot are available, and how old their data is; an extension of this robot."""

from typing import Any, Final

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.representation.writing import JSON, TEXT, XML
from reference_robot.webservices.resources.resource import Resource, represented, wanted_format
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
        return represented(await self._health.report(), "Health", media_type)
