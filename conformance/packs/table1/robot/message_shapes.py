"""JSON schemas of the robot's responses, from the contract's OpenAPI, and functions that read responses by them.

A robot may add fields to those in a schema.
"""

import json
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any, Final

from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema
from conformance.documents.json_shape import Shape
from conformance.documents.json_text import read_json
from conformance.documents.openapi import operations_of
from conformance.transport.exchange import Response

_ANSWERS: Final = {operation.id: operation.shape for operation in operations_of(Contract.load())}


def _answer_of(operation_id: str) -> Schema:
    """Return the schema of an operation's successful response in the contract."""
    schema = _ANSWERS[operation_id]
    if schema is None:
        raise ValueError(f"{operation_id} answers nothing")
    return schema


def _without(schema: Schema, name: str) -> Schema:
    """Return an object's schema without one of its members."""
    return {
        **schema,
        "required": [item for item in schema["required"] if item != name],
        "properties": {one: part for one, part in schema["properties"].items() if one != name},
    }


def _with_any_type(entries: Schema) -> Schema:
    """Return a list's schema without the rules that other requirements judge (form of ``type``, duplicates)."""
    entry = entries["items"]
    return {
        "type": "array",
        "items": {**entry, "properties": {**entry["properties"], "type": {"type": "string", "minLength": 1}}},
    }


_GOAL: Final = _answer_of("getGoal")
_SENSORS: Final = _answer_of("getSensors")
_SERVICES: Final = _answer_of("getNavigationServices")
ODOMETRY: Final = Shape(_answer_of("getPose"))
TWIST: Final = Shape(_answer_of("getVelocity"))
VECTOR3: Final = Shape(_answer_of("getLinearVelocity"))
GET_PLAN: Final = Shape(_answer_of("getPlan"))
DELIVERIES: Final = Shape(_answer_of("getDeliveries"))
GOAL: Final = Shape(_without(_GOAL, "status"))  # shape of a goal without its status, which has a requirement of its own
GOAL_POSE: Final = Shape(_GOAL["properties"]["goal"]["properties"]["target_pose"]["properties"]["pose"])
STATUS: Final = Shape(_GOAL["properties"]["status"])
GOAL_AND_STATUS: Final = Shape(_GOAL)
# The shape of a goal that has ended (contract.md#goals).
LAST_GOAL: Final = Shape(
    {
        "type": "object",
        "required": ["goal_id", "status"],
        "properties": {name: _GOAL["properties"][name] for name in ("goal_id", "status")},
    }
)
SENSORS: Final = Shape(_with_any_type(_SENSORS))
SERVICES: Final = Shape(_with_any_type(_SERVICES))
MESSAGE_TYPE: Final = Shape(_SENSORS["items"]["properties"]["type"])
SERVICE_TYPE: Final = Shape(_SERVICES["items"]["properties"]["type"])


def read_as(response: Response, shape: Shape) -> tuple[Any, str]:
    """Parse a response with status 200 by a schema.

    Returns:
        (value, ""), or (None, what is wrong with the response).
    """
    if response.status != HTTPStatus.OK:
        return None, f"status {response.status}"
    text = read_json(response.body)
    problem = text.unreadable or shape.problem(text.value)
    return (None, problem) if problem else (text.value, "")


def body_of(value: Mapping[str, Any]) -> bytes:
    """Return a value as a JSON request body."""
    return json.dumps(value).encode()
