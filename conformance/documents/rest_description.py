"""What a robot's own descriptions of its REST interface say, in the terms of the contract."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from conformance.documents.json_schema import UnresolvedError
from conformance.documents.openapi import Operation, read_operations
from conformance.documents.representation import UnreadableError, local_name, parse_xml

if TYPE_CHECKING:
    from collections.abc import Iterable

    from lxml import etree

WADL = "http://wadl.dev.java.net/2009/02"
_PARAMETER = re.compile(r"\{\s*([^{}:\s]+)\s*(?::[^{}]*(?:\{[^{}]*\}[^{}]*)*)?\}")
_KINDS = {"template": "path", "query": "query", "matrix": "matrix", "header": "header", "plain": "plain"}


@dataclass(frozen=True)
class Described:
    """One operation as a description tells it.

    Attributes:
        method: in upper case.
        path: below the base URL, with ``{name}`` for parameters.
        parameters: kind and name of each, with whether it is required.
        optional: whether a robot may do without it (known of the contract's only).
        operation: all of it, where it was read from OpenAPI.
    """

    method: str
    path: str
    parameters: frozenset[tuple[str, str, bool]]
    optional: bool = False
    operation: Operation | None = None

    @property
    def shape(self) -> str:
        """The path without the names of its parameters."""
        return _PARAMETER.sub("{}", self.path)

    @classmethod
    def of(cls, operation: Operation) -> Described:
        """From OpenAPI."""
        parameters = frozenset((item.where, item.name, item.required) for item in operation.parameters)
        return cls(operation.method, operation.template, parameters, operation.optional, operation)


def differences(wanted: Iterable[Operation], found: Iterable[Described]) -> list[str]:
    """What of the contract a description lacks, in words."""
    by_address: dict[tuple[str, str], list[Described]] = {}
    for item in found:
        by_address.setdefault((item.method, item.shape), []).append(item)
    missing = []
    for operation in wanted:
        ours = Described.of(operation)
        theirs = by_address.get((ours.method, ours.shape), [])
        if not theirs:
            if not ours.optional:
                missing.append(f"{operation.label} is missing")
            continue
        named = {(where, name): required for item in theirs for where, name, required in item.parameters}
        for where, name, required in sorted(ours.parameters):
            if (where, name) not in named:
                missing.append(f"{operation.label} lacks the {where} parameter {name}")
            elif where == "query" and named[where, name] != required:
                says = "required" if named[where, name] else "optional"
                missing.append(f"{operation.label} says that {name} is {says}")
        extra = {
            name
            for (where, name), required in named.items()
            if required
            and where == "query"
            and (where, name) not in {(kind, item) for kind, item, _ in ours.parameters}
        }
        missing += [f"{operation.label} requires {name}, which the contract does not know" for name in sorted(extra)]
    return missing


def described_by_openapi(document: Any, base_url: str) -> list[Described]:
    """The operations of a robot's OpenAPI description; what is not built as one has none."""
    if not isinstance(document, dict):
        return []
    try:
        found = [Described.of(item) for item in read_operations(document)]
    except (UnresolvedError, AttributeError, TypeError, KeyError, ValueError, RecursionError):
        return []
    servers = document.get("servers")
    first = servers[0] if isinstance(servers, list) and servers else None
    url = first.get("url") if isinstance(first, dict) else None
    prefix = urlsplit(url).path.rstrip("/") if isinstance(url, str) else ""
    return [_placed(item, prefix, base_url) for item in found]


def _placed(item: Described, prefix: str, base_url: str) -> Described:
    """An operation with its path below the base URL that the run knows."""
    path = below(prefix + item.path, base_url)
    return Described(item.method, path, item.parameters, item.optional, item.operation if path == item.path else None)


def below(path: str, base_url: str) -> str:
    """A path of the server as a path below the base URL."""
    base = urlsplit(base_url).path.rstrip("/")
    return path[len(base) :] if base and path.startswith(f"{base}/") else path


def openapi_fault(document: Any) -> str:
    """Why a document is no valid OpenAPI 3 description; empty where it is one.

    Schemathesis carries the schemas that the OpenAPI Initiative publishes, and is there anyway.
    """
    if not isinstance(document, dict):
        return "it is no object"
    version = document.get("openapi")
    if not isinstance(version, str) or not re.fullmatch(r"3\.[0-2]\.\d+", version):
        return f"its version is {version!r}"
    error = next(iter(_validator(version[:3]).iter_errors(document)), None)
    if error is not None:
        where = ".".join(str(part) for part in error.instance_path)
        return f"at {where or 'its root'}: {error.message[:200]}"
    try:
        read_operations(document)
    except UnresolvedError as unresolved:
        return str(unresolved)
    except (AttributeError, TypeError, KeyError, RecursionError) as broken:
        return f"it is not built as one: {broken!r}"
    return _path_fault(document)


@lru_cache(maxsize=4)
def _validator(version: str) -> Any:
    import jsonschema_rs  # noqa: PLC0415 - with the import below, only where a description is judged
    from schemathesis.specs.openapi import definitions  # noqa: PLC0415 - costs a fifth of a second

    schema = definitions.OPENAPI_30 if version == "3.0" else definitions.OPENAPI_31
    return jsonschema_rs.validator_for(schema)


def _path_fault(document: dict[str, Any]) -> str:
    """A path parameter that is used and not described, or described and not used (OpenAPI 3.1, 4.8.8.2)."""
    for operation in read_operations(document):
        used = set(_PARAMETER.findall(operation.template))
        told = {item.name for item in operation.parameter("path")}
        if used != told:
            return f"{operation.label} uses the path parameters {sorted(used)} and describes {sorted(told)}"
    return ""


def described_by_wadl(body: bytes, base_url: str) -> list[Described]:
    """The operations of a WADL.

    Raises:
        UnreadableError: it is no XML, or its root is no WADL application.
    """
    root = parse_xml(body)
    if root.tag != f"{{{WADL}}}application":
        raise UnreadableError(f"its root element is {root.tag}")
    found: list[Described] = []
    for resources in root.findall(f"{{{WADL}}}resources"):
        prefix = urlsplit(resources.get("base", "")).path.rstrip("/")
        for resource in resources.findall(f"{{{WADL}}}resource"):
            found += _of_resource(resource, prefix, frozenset(), root)
    return [Described(item.method, below(item.path, base_url), item.parameters) for item in found]


def _of_resource(
    element: etree._Element, prefix: str, inherited: frozenset[tuple[str, str, bool]], root: etree._Element
) -> list[Described]:
    path = f"{prefix}/{element.get('path', '').lstrip('/')}" if element.get("path") else prefix
    parameters = inherited | _parameters(element)
    found: list[Described] = []
    for child in element:
        if not isinstance(child.tag, str):
            continue
        if local_name(child) == "resource":
            found += _of_resource(child, path.rstrip("/"), parameters, root)
        elif local_name(child) == "method":
            method = _referred(child, root)
            own = parameters
            for request in method.findall(f"{{{WADL}}}request"):
                own |= _parameters(request)
            named = frozenset((where, name, required or where == "path") for where, name, required in own)
            found.append(Described(method.get("name", "").upper(), _PARAMETER.sub(r"{\1}", path), named))
    return found


def _referred(method: etree._Element, root: etree._Element) -> etree._Element:
    """A method, or the one that it refers to by ``href="#id"``."""
    name = method.get("href", "").lstrip("#")
    return next((item for item in root.iter(f"{{{WADL}}}method") if name and item.get("id") == name), method)


def _parameters(element: etree._Element) -> frozenset[tuple[str, str, bool]]:
    return frozenset(
        (
            _KINDS.get(item.get("style", ""), item.get("style", "")),
            item.get("name", ""),
            item.get("required", "false") in {"true", "1"},
        )
        for item in element.findall(f"{{{WADL}}}param")
    )
