"""Compare a robot's own REST descriptions (OpenAPI, WADL) with the contract, and with exchanges of the run."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final
from urllib.parse import urlsplit

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.validity import INVALID, VALID, validity, validity_by
from conformance.documents.json_schema import UnresolvedError
from conformance.documents.json_shape import shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import PARAMETER, Operation, is_json, read_operations
from conformance.documents.parameters import Parameter
from conformance.documents.patterns import PatternError
from conformance.documents.wadl import read_wadl
from conformance.transport.exchange import Exchange, Listener


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


# Exchanges of different lengths that are kept for each operation.
_MOST: Final = 12


class KeptExchanges(Listener):
    """Keeps some successful exchanges for each operation: the first ones, and the one with the longest request.

    Args:
        api: the robot's REST interface.

    Attributes:
        kept: the exchanges with their operations.
    """

    def __init__(self, api: RestInterface) -> None:
        self.kept: dict[str, list[tuple[RequestContext, Exchange]]] = {}
        self._api = api
        self._lengths: set[tuple[str, int, int]] = set()

    def on_response(self, exchange: Exchange) -> None:
        """Keep an exchange if it is of another length than those before."""
        request, answer = exchange.request, exchange.response
        if not answer.ok or request.raw is not None or request.method in {"HEAD", "OPTIONS"}:
            return
        context = RequestContext.of(self._api.run.contract, self._api.client.base_url, request)
        if context is None or context.operation is None:
            return
        label = context.operation.label
        lengths = (label, request.size, len(answer.body))
        kept = self.kept.setdefault(label, [])
        if lengths in self._lengths:
            return
        if len(kept) < _MOST:
            kept.append((context, exchange))
            self._lengths.add(lengths)
        elif request.size > kept[-1][1].request.size:
            kept[-1] = context, exchange


def contradiction(api: RestInterface, theirs: Described, context: RequestContext, exchange: Exchange) -> str:
    """Return how a successful exchange contradicts the robot's description, or an empty text.

    Args:
        api: the robot's REST interface.
        theirs: the operation in the robot's description.
        context: the request, which the robot has accepted; it counts only if the contract allows it.
        exchange: request and response.
    """
    request, answer = exchange.request, exchange.response
    own = replace(theirs.operation, template=theirs.path)
    if validity(api.run.contract, request.method, context.target, request.media_type, request.body).verdict == VALID:
        path, _, query = context.target.partition("?")
        said = validity_by(own, path, query, request.media_type, request.body)
        if said.verdict == INVALID:
            return f"a request that the description forbids: {said.why}"
    schema = (own.schemas_for(answer.status) or {}).get(answer.media_type)
    text = read_json(answer.body) if schema and is_json(answer.media_type) else None
    try:
        problem = shape_of(schema).problem(text.value) if schema and text and not text.problem else ""
    except PatternError:
        problem = ""  # another requirement says that the schema cannot be used
    return f"a response that the description does not have: {problem}" if problem else ""
