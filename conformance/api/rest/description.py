"""Compare a robot's own REST descriptions (OpenAPI, WADL) with the contract."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from conformance.documents.json_schema import UnresolvedError
from conformance.documents.openapi import PARAMETER, Operation, read_operations
from conformance.documents.parameters import Parameter
from conformance.documents.wadl import read_wadl


@dataclass(frozen=True)
class Described:
    """One operation of a robot's description.

    Attributes:
        operation: the operation as described.
        path: path below the base URL of the run; the description's own path may have another prefix.
    """

    operation: Operation
    path: str

    @property
    def address(self) -> tuple[str, str]:
        """Method, and path without the names of parameters."""
        return self.operation.method, PARAMETER.sub("{}", self.path)


def described_by_openapi(document: Any, base_url: str) -> list[Described]:
    """Return the operations of a robot's OpenAPI description; empty if it is malformed."""
    if not isinstance(document, dict):
        return []
    try:
        found = read_operations(document)
    except (UnresolvedError, AttributeError, TypeError, KeyError, ValueError, RecursionError):
        return []
    servers = document.get("servers")
    first = servers[0] if isinstance(servers, list) and servers else None
    url = first.get("url") if isinstance(first, dict) else None
    prefix = urlsplit(url).path.rstrip("/") if isinstance(url, str) else ""
    return [Described(item, _below(prefix + item.template, base_url)) for item in found]


def described_by_wadl(body: bytes, base_url: str) -> list[Described]:
    """Return the operations of a robot's WADL.

    Raises:
        UnreadableError: it is not XML, or its root is not a WADL application.
    """
    return [Described(item, _below(item.template, base_url)) for item in read_wadl(body)]


def _below(path: str, base_url: str) -> str:
    """Return a path of the server as a path below the base URL."""
    base = urlsplit(base_url).path.rstrip("/")
    return path[len(base) :] if base and path.startswith(f"{base}/") else path


def differences(wanted: Iterable[Operation], found: Iterable[Described]) -> list[str]:
    """Return, in words, the operations and parameters of the contract that a description lacks."""
    by_address: dict[tuple[str, str], list[Operation]] = {}
    for item in found:
        by_address.setdefault(item.address, []).append(item.operation)
    missing = []
    for ours in wanted:
        theirs = by_address.get(Described(ours, ours.template).address, [])
        if theirs:
            missing += _differences_of_parameters(ours, theirs)
        elif not ours.optional:
            missing.append(f"no {ours.label}")
    return missing


def _differences_of_parameters(ours: Operation, theirs: list[Operation]) -> list[str]:
    described = {
        (parameter.where, parameter.name): parameter for operation in theirs for parameter in operation.parameters
    }
    missing = []
    for one in sorted(ours.parameters, key=lambda item: (item.where, item.name)):
        where, name, their = one.where, one.name, described.get((one.where, one.name))
        if their is None:
            missing.append(f"{ours.label} without the {where} parameter {name}")
        elif where == "query" and their.required != one.required:
            missing.append(f"{ours.label} with the parameter {name} as {'optional' if one.required else 'required'}")
        elif not _same_default(one, their):
            default, other = one.schema.get("default"), their.schema.get("default")
            missing.append(f"{ours.label} with the default {other!r} of the parameter {name} instead of {default!r}")
    known = {parameter.name for parameter in ours.parameters if parameter.where == "query"}
    extra = {name for (where, name), one in described.items() if one.required and where == "query"} - known
    return [
        *missing,
        *(
            f"{ours.label} with the required parameter {name}, which the contract does not have"
            for name in sorted(extra)
        ),
    ]


def _same_default(ours: Parameter, theirs: Parameter) -> bool:
    """Return whether two defaults are equal, where both are there; a WADL writes each as text."""
    default, other = ours.schema.get("default"), theirs.schema.get("default")
    if default is None or other is None:
        return True
    try:
        return float(default) == float(other)
    except (TypeError, ValueError):
        return bool(str(default) == str(other))
