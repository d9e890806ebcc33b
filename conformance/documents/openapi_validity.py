"""Check whether a document is a valid OpenAPI description: schema of its version, references, path parameters."""

import re
from collections.abc import Sequence
from typing import Any

from conformance.documents.description_faults import validator
from conformance.documents.json_schema import UnresolvedError
from conformance.documents.openapi import Operation, read_operations
from conformance.documents.resources import PARAMETER


def openapi_fault(document: Any) -> str:
    """Return why a document is not a valid OpenAPI 3 description; empty if it is."""
    if not isinstance(document, dict):
        return "it is no object"
    version = document.get("openapi")
    if not isinstance(version, str) or not re.fullmatch(r"3\.[0-2]\.\d+", version):
        return f"a description of version {version!r}"
    error = next(iter(validator(version[:3]).iter_errors(document)), None)
    if error is not None:
        where = ".".join(str(part) for part in error.instance_path)
        return f"a fault at {where or 'the root'}: {error.message[:200]}"
    try:
        operations = read_operations(document)
    except UnresolvedError as unresolved:
        return str(unresolved)
    except (AttributeError, TypeError, KeyError, RecursionError) as broken:
        return f"no description: {broken!r}"
    return _path_fault(operations)


def _path_fault(operations: Sequence[Operation]) -> str:
    """Return a path parameter that is in a path but not described, or the reverse (OpenAPI 3.1, 4.8.8.2); or empty."""
    for operation in operations:
        used = set(PARAMETER.findall(operation.template))
        described = {item.name for item in operation.parameter("path")}
        if used != described:
            return f"{operation.label} with the path parameters {sorted(used)} and {sorted(described)} described"
    return ""
