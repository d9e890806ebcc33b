"""Security schemes of a description: where credentials go, and which operations demand them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any, Final

from conformance.documents.json_schema import Schema, UnresolvedError, target_of
from conformance.documents.openapi import Operation, methods_of, with_methods

#: Where a credential is sent (header, query, cookie), and its name there; header names are in lower case.
Place = tuple[str, str]
# Schemes with credentials that HTTP knows: Authorization, and 401 with a challenge (RFC 9110 11).
_OF_HTTP: Final = frozenset({"http", "oauth2", "openIdConnect"})
_AUTHORIZATION: Final = ("header", "authorization")


def place_of(where: str, name: str) -> Place:
    """Return a place in the form in which places are compared."""
    return where, name.lower() if where == "header" else name


def schemes_of(document: Schema) -> dict[str, Schema]:
    """Return the security schemes of a description by name, without those that cannot be read."""
    components = document.get("components")
    schemes = components.get("securitySchemes") if isinstance(components, dict) else None
    found = {}
    for name, scheme in schemes.items() if isinstance(schemes, dict) else ():
        read = _follow(document, scheme)
        if isinstance(read, dict):
            found[str(name)] = read
    return found


def demands(document: Schema, operation: Operation) -> bool:
    """Return whether an operation demands a credential that a request carries.

    An alternative without a scheme makes credentials optional (OpenAPI 3.1, 4.8.30). A client certificate is no part of
    a request.
    """
    schemes = schemes_of(document)
    carried = [
        [name for name in names if schemes.get(name, {}).get("type") != "mutualTLS"] for names in operation.security
    ]
    return bool(carried) and all(carried)


def is_http_authentication(document: Schema, operation: Operation) -> bool:
    """Return whether an operation demands credentials by HTTP's own authentication in each alternative."""
    schemes = schemes_of(document)
    kinds = [{schemes.get(name, {}).get("type") for name in names} for names in operation.security]
    return bool(kinds) and all(_OF_HTTP & kind for kind in kinds)


def without_credentials(document: Schema, given: Collection[Place] = ()) -> Schema:
    """Return a description without the parameters that carry credentials: they are not the suite's to make up.

    Args:
        document: one OpenAPI 3 document.
        given: places that the run's own credentials and fixed headers fill in every request.
    """
    schemes = schemes_of(document)
    paths = document.get("paths")
    if not isinstance(paths, dict):
        return document
    shared = document.get("security", [])

    def drop(given: Any, taken: Collection[Place]) -> Any:
        if not isinstance(given, dict) or not isinstance(given.get("parameters"), list):
            return given
        return {**given, "parameters": [item for item in given["parameters"] if _place(document, item) not in taken]}

    found = {}
    for path, item in paths.items():
        operations = methods_of(item) if isinstance(item, dict) else {}
        taken = {
            method: {*given, *_places(schemes, one.get("security", shared))}
            for method, one in operations.items()
            if isinstance(one, dict)
        }
        # A parameter of the path is dropped if all its operations treat it as a credential.
        changed = drop(item, set.intersection(*taken.values())) if taken else item
        found[path] = with_methods(changed, {method: drop(operations[method], taken[method]) for method in taken})
    return {**document, "paths": found}


def _places(schemes: dict[str, Schema], security: Any) -> Iterator[Place]:
    """Yield the places of the credentials that an operation's requirements name."""
    for alternative in security if isinstance(security, list) else ():
        for name in alternative if isinstance(alternative, dict) else ():
            scheme = schemes.get(name, {})
            if scheme.get("type") == "apiKey":
                yield place_of(str(scheme.get("in", "")), str(scheme.get("name", "")))
            elif str(scheme.get("type")) in _OF_HTTP:
                yield _AUTHORIZATION


def _place(document: Schema, parameter: Any) -> Place | None:
    read = _follow(document, parameter)
    return place_of(str(read.get("in", "")), str(read.get("name", ""))) if isinstance(read, dict) else None


def _follow(document: Schema, value: Any) -> Any:
    try:
        return target_of(document, value["$ref"]) if isinstance(value, dict) and "$ref" in value else value
    except (UnresolvedError, AttributeError):
        return None
