"""Request bodies that differ from a valid one in a single respect."""

from collections.abc import Iterator
from typing import Any

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.json_mutations import near_misses
from conformance.documents.openapi import operations_of
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import Robot
from conformance.transport.exchange import Exchange


def invalid_bodies(api: RestInterface, path: str, valid: dict[str, Any], number: str) -> list[tuple[str, str, bytes]]:
    """Return bodies that would move the robot if it accepted them, as (what is wrong, media type, body).

    Args:
        api: the robot's REST interface.
        path: the resource.
        valid: a valid JSON object.
        number: where in the object a number is, as names with dots between them.
    """
    put = next(item for item in operations_of(api.run.contract) if (item.method, item.template) == ("PUT", path))
    made = near_misses(valid, put.bodies[JSON].schema, tuple(number.split(".")))
    return [*((item.what, JSON, item.made) for item in made), ("text/plain", "text/plain", body_of(valid))]


def put_body(robot: Robot, path: str, media_type: str, body: bytes) -> Exchange:
    """PUT a body of a media type, and return the exchange."""
    return robot.rest.send("PUT", path, headers=(("Content-Type", media_type),), body=body)


def elsewhere(robot: Robot, path: str) -> Iterator[tuple[str, str]]:
    """Yield methods that a resource does not have, and PUT without its slash (contract.md#addresses), with the path."""
    allowed = robot.rest.send("OPTIONS", path).response.header("Allow") or ""
    yield from ((method, path) for method in ("POST", "PATCH") if method not in allowed)
    yield "PUT", path.rstrip("/")
