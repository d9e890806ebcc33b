"""Generate requests with Schemathesis. They are sent by the suite's client and judged by the suite.

Schemathesis's own checks accept 5xx as a refusal and may consider data invalid that is valid once serialised. So each
request is parsed from its bytes (validity.py) and judged by that.
"""

import re
import warnings
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

import requests
import schemathesis
from hypothesis.errors import Unsatisfiable
from hypothesis.strategies import SearchStrategy
from schemathesis import GenerationMode
from schemathesis.config import SchemathesisConfig
from schemathesis.core.result import Ok
from schemathesis.errors import SerializationNotPossible
from schemathesis.generation.drivers import CoverageGenerator
from schemathesis.generation.feedback import NO_FEEDBACK
from schemathesis.generation.overrides import Override

from conformance.contract.pack import Contract
from conformance.documents.patterns import with_python_patterns
from conformance.documents.schema_budget import unrolls
from conformance.transport.exchange import Outgoing

#: Exceptions of Schemathesis when it can make no request: a schema allows everything or nothing, or a media type is
#: unknown.
NOT_GENERATED = (Unsatisfiable, SerializationNotPossible)
_BASE = "http://robot.invalid"
# A header's name and value (RFC 9110 5.1, 5.5), in the forms that every server accepts.
_FIELD = re.compile(r"[!#$%&'*+\-.^_`|~0-9A-Za-z]+")
_VALUE = re.compile(r"[!-~](?:[ -~]*[!-~])?")


@dataclass(frozen=True)
class Target:
    """One operation, as Schemathesis represents it.

    Attributes:
        label: method and path.
        operation: the Schemathesis object.
        schema: the Schemathesis schema of the contract.
    """

    label: str
    operation: Any
    schema: Any

    @property
    def has_input(self) -> bool:
        """Whether its requests have parameters or a body."""
        return any(True for _ in self.operation.iter_parameters()) or bool(list(self.operation.body))

    def covering(self) -> Any:
        """Return an iterable of Schemathesis cases on both sides of each constraint of the schemas."""
        # Schemathesis follows each reference of each member, in time and memory without bound.
        if unrolls(self.schema.raw_schema, self.operation.definition.raw):
            return ()
        config = self.schema.config.generation_for(operation=self.operation, phase="coverage")
        return CoverageGenerator(
            operation=self.operation,
            generation_modes=[GenerationMode.POSITIVE, GenerationMode.NEGATIVE],
            generation_config=config,
            auth_storage=None,
            override=Override(),
            feedback=NO_FEEDBACK,
        )

    def strategy(self, *, negative: bool) -> SearchStrategy[Any]:
        """Return a strategy for Schemathesis cases that fit the schemas, or violate them."""
        mode = GenerationMode.NEGATIVE if negative else GenerationMode.POSITIVE
        strategy: SearchStrategy[Any] = self.operation.as_strategy(generation_mode=mode)
        return strategy


def targets(contract: Contract, *, undeclared: bool = False) -> tuple[Target, ...]:
    """Return the operations of a contract, except those that Schemathesis cannot read.

    The schema is loaded anew each time, because Schemathesis stores in it which cases it has generated.

    Args:
        contract: the contract.
        undeclared: whether to cover methods that a path does not declare, which may act on a device that has them.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        schema = _load_schema(contract.openapi, undeclared=undeclared)
        found = []
        for result in schema.get_all_operations():
            operation: Any = result.ok() if isinstance(result, Ok) else None
            if operation is None:
                continue
            found.append(Target(operation.label, operation, schema))
        return tuple(found)


def _load_schema(document: dict[str, Any], *, undeclared: bool = False) -> Any:
    """Return the Schemathesis schema of a document without its credentials: the client adds those of the run.

    A case that left them out would be judged by a request that was sent with them.
    """
    phases: dict[str, Any] = {} if undeclared else {"coverage": {"unexpected-methods": []}}
    config = SchemathesisConfig.from_dict({"generation": {"with-security-parameters": False}, "phases": phases})
    # Schemathesis would fetch the metaschema that `$schema` names.
    document = {key: value for key, value in document.items() if key != "$schema"}
    return schemathesis.openapi.from_dict(_without_pointers(with_python_patterns(document)), config=config)


def _without_pointers(value: Any) -> Any:
    """Return a value without references to other documents, which Schemathesis would load from anywhere."""
    if isinstance(value, list):
        return [_without_pointers(item) for item in value]
    if not isinstance(value, dict):
        return value
    return {key: _without_pointers(item) for key, item in value.items() if not _points_elsewhere(key, item)}


def _points_elsewhere(key: Any, value: Any) -> bool:
    is_reference = key in {"$ref", "operationRef"} and not str(value).startswith("#")
    return isinstance(value, str) and (is_reference or key == "externalValue")


def as_request(case: Any) -> Outgoing | None:
    """Return a Schemathesis case as a request, or None if HTTP cannot transmit it."""
    try:
        given = case.as_transport_kwargs(base_url=_BASE)
        keys = ("method", "url", "files", "data", "json", "params", "cookies")
        request = requests.Request(
            **{key: given[key] for key in keys if key in given}, headers=dict(given.get("headers") or {})
        ).prepare()
    except (ValueError, TypeError, requests.RequestException, UnicodeError):
        return None
    url = urlsplit(request.url or "")
    body = request.body or b""
    if not isinstance(body, str | bytes):
        return None
    # For an operation without a body, Schemathesis may invent a media type, even a multipart type without its boundary.
    content_type = str(request.headers.get("Content-Type") or "") if body or case.operation.body else ""
    target = (url.path or "/") + (f"?{url.query}" if url.query else "")
    method = str(request.method)
    if not (content_type.isprintable() and content_type.isascii() and target.isascii() and method.isascii()):
        return None
    return Outgoing.of(method, target, content_type, body.encode() if isinstance(body, str) else body)


def own_headers(case: Any) -> tuple[tuple[str, str], ...] | None:
    """Return the header and cookie parameters of a case; None if HTTP cannot transmit them."""
    pairs = [(str(name), str(value)) for name, value in (case.headers or {}).items()]
    cookies = "; ".join(f"{name}={value}" for name, value in (case.cookies or {}).items())
    pairs += [("Cookie", cookies)] if cookies else []
    sendable = all(_FIELD.fullmatch(name) and (value == "" or _VALUE.fullmatch(value)) for name, value in pairs)
    return tuple(pair for pair in pairs if pair[0].lower() != "content-type") if sendable else None
