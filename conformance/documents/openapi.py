"""The operations of a contract, from its OpenAPI description."""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from typing import Any, Final

from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.documents.json_schema import (
    CHANGES,
    MOST_NODES,
    Schema,
    UnresolvedError,
    changed_alike,
    modern,
    opened,
    resolved,
)
from conformance.documents.parameters import (
    Encoding,
    Parameter,
    by_media_type,
    examples_of,
    read_encoding,
    read_parameter,
)

_METHODS = ("get", "put", "post", "delete", "patch", "head", "options", "trace", "query")
SAFE = frozenset({"GET", "HEAD", "OPTIONS", "TRACE", "QUERY"})
# So many nodes of a document are copied for all its paths, and at least so many for each; what many refer to beyond
# that is read once for all of them.
_NODES_IN_ALL: Final = 500_000
_FEWEST_NODES: Final = 100


@dataclass(frozen=True)
class Body:
    """One media type of an operation's request body.

    Attributes:
        media_type: without parameters.
        schema: of the value.
        examples: example values (text for XML) in the description; may be empty.
        encoding: how the fields of a form are written, where the description says it.
    """

    media_type: str
    schema: Schema
    examples: tuple[Any, ...] = ()
    encoding: dict[str, Encoding] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Operation:
    """One method of one resource.

    Attributes:
        id: operationId, or method and path without one.
        method: in upper case.
        template: path with ``{name}`` for parameters.
        parameters: of path and operation.
        bodies: possible request bodies, by media type.
        body_required: whether a request must have a body.
        responses: schemas of response bodies, by status ("200", "2XX", "default") and media type; further members
            allowed.
        motion: whether it may move the robot or change persistent state.
        optional: whether a robot need not implement it.
        headers: required flag and schema of response headers, by status and name in lower case.
        tags: groups that the description puts it in.
        security: names of the security schemes of each alternative; empty: none is needed.
        never: whether the description says that a test must not send it (x-roaas-never).
        stop: whether it stops the device (x-roaas-stop).
        reads: whether it only reads, whatever its method (x-roaas-reads).
        text: what its summary and its description say.
    """

    id: str
    method: str
    template: str
    parameters: tuple[Parameter, ...] = ()
    bodies: dict[str, Body] = field(default_factory=dict)
    body_required: bool = False
    responses: dict[str, dict[str, Schema]] = field(default_factory=dict)
    motion: bool = False
    optional: bool = False
    headers: dict[str, dict[str, tuple[bool, Schema]]] = field(default_factory=dict)
    tags: tuple[str, ...] = ()
    security: tuple[tuple[str, ...], ...] = ()
    never: bool = False
    stop: bool = False
    reads: bool = False
    text: str = ""

    @cached_property
    def label(self) -> str:
        """Method and path."""
        return f"{self.method} {self.template}"

    @property
    def safe(self) -> bool:
        """Whether it only reads: its method is safe (RFC 9110 9.2.1), or it says so."""
        return self.method in SAFE or self.reads

    def declared(self, status: int) -> dict[str, Schema] | None:
        """Return the schemas by media type for a status; None if the status is not declared."""
        key = self.response_key(status)
        return None if key is None else self.responses[key]

    def response_key(self, status: int) -> str | None:
        """Return the key under which a status is declared: itself, its class or ``default``; None if it is not."""
        keys = (str(status), f"{status // 100}XX", f"{status // 100}xx", "default")
        return next((key for key in keys if key in self.responses), None)

    @cached_property
    def formats(self) -> tuple[str, ...]:
        """The media types of its successful responses, in the description's order."""
        found = [name for status, content in self.responses.items() if status.startswith("2") for name in content]
        return tuple(dict.fromkeys(found))

    @cached_property
    def shape(self) -> Schema | None:
        """The schema of its successful response's body, or None."""
        for status, content in self.responses.items():
            if status.startswith("2"):
                for media_type, schema in content.items():
                    if is_json(media_type):
                        return schema
        return None

    def parameter(self, where: str) -> tuple[Parameter, ...]:
        """Return the parameters of one kind: path, query, header or cookie."""
        return tuple(item for item in self.parameters if item.where == where)


def is_json(media_type: str) -> bool:
    """Return whether a media type is JSON (RFC 6839 3.1)."""
    return media_type == "application/json" or media_type.endswith("+json")


def is_xml(media_type: str) -> bool:
    """Return whether a media type is XML (RFC 7303 4)."""
    return media_type in {"application/xml", "text/xml"} or media_type.endswith("+xml")


@lru_cache(maxsize=8)
def operations_of(contract: Contract) -> tuple[Operation, ...]:
    """Return all operations of a contract, in the description's order.

    Raises:
        ContractError: the OpenAPI description is malformed, or a reference has no target.
    """
    try:
        return tuple(read_operations(contract.openapi, closed=contract.closed_answers))
    except (UnresolvedError, AttributeError, TypeError, KeyError) as error:
        raise ContractError(f"{contract.openapi_path} is no usable OpenAPI description: {error}") from error


def read_operations(document: Schema, *, closed: bool = False) -> list[Operation]:
    """Return the operations of an OpenAPI document.

    Args:
        document: the document, without references to other files.
        closed: whether ``additionalProperties: false`` binds responses too; otherwise they may have further members.

    Raises:
        UnresolvedError, AttributeError, TypeError, KeyError: the document is malformed.
    """
    found: list[Operation] = []
    security = document.get("security", ())
    paths = document.get("paths", {})
    most = max(_FEWEST_NODES, min(MOST_NODES, _NODES_IN_ALL // max(1, len(paths))))
    for path, item in paths.items():
        whole = resolved(document, item, most)
        shared = whole.get("parameters", [])
        found += [
            _operation(path, method, {"security": security, **given}, shared, closed=closed)
            for method, given in methods_of(whole).items()
        ]
    return found


def methods_of(item: Schema) -> dict[str, Any]:
    """Return the operations of a path item by method, those in ``additionalOperations`` too (OpenAPI 3.2, 4.9)."""
    more = item.get("additionalOperations")
    return {name.upper(): item[name] for name in _METHODS if name in item} | (more if isinstance(more, dict) else {})


def with_methods(item: Any, changed: dict[str, Any]) -> Any:
    """Return a path item with other operations in the places of some, by method as `methods_of` has them."""
    if not changed:
        return item
    own = {name: changed[name.upper()] for name in _METHODS if name in item and name.upper() in changed}
    more = item.get("additionalOperations")
    if isinstance(more, dict):
        own["additionalOperations"] = {method: changed.get(method, one) for method, one in more.items()}
    return {**item, **own}


def _operation(
    path: str, method: str, given: dict[str, Any], shared: list[dict[str, Any]], *, closed: bool
) -> Operation:
    own = {(item["name"], item["in"]) for item in given.get("parameters", [])}
    parameters = [item for item in shared if (item["name"], item["in"]) not in own] + given.get("parameters", [])
    body = given.get("requestBody", {})
    return Operation(
        id=given.get("operationId", f"{method} {path}"),
        method=method,
        template=path,
        parameters=tuple(read_parameter(item) for item in parameters),
        bodies={
            name: Body(
                name,
                without_marked(modern(content.get("schema", {})), "readOnly"),
                examples_of(content),
                read_encoding(content),
            )
            for name, content in by_media_type(body).items()
        },
        body_required=bool(body.get("required", False)),
        responses={
            str(status): {
                name: _answer(content.get("schema", {}), closed=closed)
                for name, content in by_media_type(response).items()
            }
            for status, response in given.get("responses", {}).items()
        },
        # Of a device with a contract, whatever is not safe may move it; of any other, what is said to.
        motion=bool(given.get("x-roaas-motion", method not in SAFE and not closed)),
        optional=bool(given.get("x-roaas-optional", False)),
        headers={str(status): _headers(response) for status, response in given.get("responses", {}).items()},
        tags=tuple(given.get("tags", ())),
        security=tuple(tuple(alternative) for alternative in given["security"]),
        never=bool(given.get("x-roaas-never", False)),
        stop=bool(given.get("x-roaas-stop", False)),
        reads=bool(given.get("x-roaas-reads", False)),
        text=" ".join(one for key in ("summary", "description") if isinstance(one := given.get(key), str)),
    )


def _answer(schema: Any, *, closed: bool) -> Schema:
    """Return the schema of a response body: as it is if ``closed``, but without members that only requests have."""
    answer: Schema = without_marked(modern(schema), "writeOnly") if closed else opened(modern(schema))
    return answer


def without_marked(schema: Any, mark: str) -> Any:
    """Return a schema in which no member with this mark is required (readOnly, writeOnly; OpenAPI 3.0, 4.7.24.2)."""
    if isinstance(schema, list):
        return [without_marked(item, mark) for item in schema]
    if not isinstance(schema, dict):
        return schema
    result = changed_alike({key: without_marked(item, mark) for key, item in schema.items()}, mark)
    properties, required = result.get("properties"), result.get("required")
    if isinstance(properties, dict) and isinstance(required, list):
        marked = _marked(properties, mark)
        result["required"] = [name for name in required if name not in marked]
    if isinstance(properties, dict) and mark == "readOnly":
        # A device ignores such a member of a request, whatever its value.
        result["properties"] = {**properties, **{name: {"readOnly": True} for name in _marked(properties, mark)}}
    return result


CHANGES.update(readOnly=partial(without_marked, mark="readOnly"), writeOnly=partial(without_marked, mark="writeOnly"))


def _marked(properties: dict[str, Any], mark: str) -> set[str]:
    return {name for name, part in properties.items() if isinstance(part, dict) and part.get(mark) is True}


def _headers(response: dict[str, Any]) -> dict[str, tuple[bool, Schema]]:
    return {
        name.lower(): (bool(header.get("required", False)), modern(header.get("schema", {})))
        for name, header in response.get("headers", {}).items()
        # OpenAPI 3.1, 4.8.17.1: a Content-Type header in this place is ignored.
        if name.lower() != "content-type"
    }
