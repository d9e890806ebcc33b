"""What an operation that never answered 2xx would need, by the status of its usual request."""

from __future__ import annotations

from typing import Final

from conformance.api.rest.statuses import HELD
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import Operation
from conformance.documents.representation import flat

_VALUES: Final = "values that the device knows"
_CREDENTIALS: Final = "credentials that may do this"
_OF_STATUS: Final = {
    400: _VALUES,
    401: _CREDENTIALS,
    403: _CREDENTIALS,
    404: _VALUES,
    407: _CREDENTIALS,
    409: "another state of the device",
    410: _VALUES,
    412: "a condition that holds, such as the present ETag in If-Match",
    415: _VALUES,
    422: _VALUES,
    423: "a lock or lease that another client may hold",
    428: "a condition, such as the present ETag in If-Match",
    429: "a device that is less busy",
    503: "a device that is less busy",
    507: "room on the device",
}


def need_of(operation: Operation, status: int) -> tuple[str, list[str]]:
    """Return what an operation needs to succeed, as a noun phrase, and the names of the values that may help.

    Args:
        operation: it never answered 2xx.
        status: that of its usual request.
    """
    need = _OF_STATUS.get(status, "")
    in_path = [item.name for item in operation.parameter("path")]
    if need != _VALUES:
        # Another thing of the same kind may be in the right state.
        return need, in_path if status in HELD else []
    required = [item.name for item in operation.parameters if item.required and item.where != "path"]
    members = [name for body in operation.bodies.values() for name in _members(body.schema)]
    names = in_path if in_path and status in {404, 410} else [*in_path, *required, *members]
    names = list(dict.fromkeys(names))
    return (f"{need}: {', '.join(names)}" if names else ""), names


def _members(schema: Schema) -> list[str]:
    """Return the members of an object that are required."""
    whole = flat(schema)
    required = whole.get("required", ())
    return [name for name in whole.get("properties", {}) if name in required]
