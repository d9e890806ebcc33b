"""Decide by rule whether an altered message breaks a norm or a device's own description: only such changes count.

A mutant of a described device alters a message only where one of these functions says that the altered message is a
breach. So nothing that norms and description leave open is ever counted, whatever the device sends.
"""

import json
from functools import lru_cache
from typing import Any

import jsonschema_rs

from conformance.documents.json_schema import Schema, target_of_lazy
from conformance.documents.json_shape import Kept, validator_of
from conformance.documents.openapi import Operation, is_json
from proof.mutation.messages import Response

# Statuses that any HTTP server may send without a declaration (RFC 9110 15, OpenAPI 3.1 4.8.16).
ANY_SERVER = frozenset(
    {206, 304, 401, 403, 405, 406, 407, 408, 411, 412, 413, 414, 415, 416, 417, 421, 426, 428, 429, 431, 501, 503}
)


def valid(schema: Schema, value: Any) -> bool:
    """Return whether a value is valid by a schema and its formats; an unusable schema allows everything."""
    validator = _VALIDATORS.of(schema)
    try:
        return validator is None or bool(validator.is_valid(value))
    except (ValueError, TypeError, OverflowError):
        return False


def _validator(schema: Schema) -> Any:
    try:
        return validator_of(schema, lambda uri, value: valid(target_of_lazy(uri), value), validate_formats=True)
    except (ValueError, jsonschema_rs.ValidationError):
        return None


_VALIDATORS = Kept(_validator)


@lru_cache(maxsize=4096)
def _json(body: bytes) -> tuple[bool, Any]:
    try:
        return True, json.loads(body.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError):
        return False, None


def _no_constant(name: str) -> Any:
    raise ValueError(name)


def undeclared_status(operation: Operation, answer: Response) -> bool:
    """Return whether the description declares statuses but not this one, which no web server sends by itself."""
    return (
        bool(operation.responses) and operation.response_key(answer.status) is None and answer.status not in ANY_SERVER
    )


def undeclared_type(operation: Operation, answer: Response) -> bool:
    """Return whether a body has another media type than those that are declared for its status."""
    content = operation.schemas_for(answer.status)
    return bool(content and answer.body) and not any(_names(name, answer.media_type) for name in content or ())


def _names(declared: str, given: str) -> bool:
    return declared in {given, "*/*"} or (declared.endswith("/*") and given.startswith(declared[:-1]))


def schema_of(operation: Operation, answer: Response) -> Schema | None:
    """Return the schema that is declared for a response's status and JSON media type, or None."""
    content = operation.schemas_for(answer.status) or {}
    if not is_json(answer.media_type):
        return None
    return next((schema for name, schema in content.items() if _names(name, answer.media_type)), None)


def broken_body(operation: Operation, answer: Response) -> bool:
    """Return whether a body that claims to be JSON is malformed (RFC 8259 2, 8.1), or invalid by its schema."""
    if answer.method == "HEAD" or not is_json(answer.media_type):
        return False
    is_read, value = _json(answer.body)
    schema = schema_of(operation, answer)
    if not is_read:
        return bool(answer.body) or schema is not None
    return schema is not None and not valid(schema, value)


def breaks(operation: Operation, answer: Response) -> bool:
    """Return whether a response breaks the description, or is JSON that is none."""
    return undeclared_status(operation, answer) or undeclared_type(operation, answer) or broken_body(operation, answer)
