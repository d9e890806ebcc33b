"""Operations of a contract's OpenAPI description, and which of them serves a path and method."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any, Final
from urllib.parse import unquote

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
    target_of,
)
from conformance.documents.parameters import (
    Encoding,
    Parameter,
    by_media_type,
    examples_of,
    read_encoding,
    read_parameter,
)
from conformance.transport.exchange import sendable

_METHODS = ("get", "put", "post", "delete", "patch", "head", "options", "trace", "query")
SAFE = frozenset({"GET", "HEAD", "OPTIONS", "TRACE", "QUERY"})
_NODES_IN_ALL: Final = 500_000  # values of a document that are copied for all paths together
_FEWEST_NODES: Final = 100  # values that are copied for each path even then


@dataclass(frozen=True)
class Body:
    """One media type of an operation's request body.

    Attributes:
        media_type: without parameters.
        schema: the schema of the value.
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
        parameters: parameters of path and operation.
        bodies: possible request bodies, by media type.
        body_required: whether a request must have a body.
        responses: schemas of response bodies, by status ("200", "2XX", "default") and media type; further members
            allowed.
        motion: whether it may move the robot or change persistent state.
        optional: whether a robot need not implement it.
        headers: required flag and schema of response headers, by status and name in lower case.
        tags: groups that the description puts it in.
        security: names of the security schemes of each alternative; empty if none is needed.
        never: whether the description says that a test must not send it (x-roaas-never).
        stop: whether it stops the device (x-roaas-stop).
        reads: whether it only reads, whatever its method (x-roaas-reads).
        created: whether it updates a thing that another operation creates (x-roaas-created).
        text: what its summary and its description say.
        conflict: what the description of its status 409 says.
        success: what the descriptions of its statuses 2xx say.
        guessed: what a read without a declared content may show, by what is written there; nothing is judged by it.
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
    created: bool = False
    text: str = ""
    conflict: str = ""
    success: str = ""
    guessed: Schema | None = None

    @cached_property
    def label(self) -> str:
        """Method and path."""
        return f"{self.method} {self.template}"

    @property
    def safe(self) -> bool:
        """Return whether the operation only reads: its method is safe (RFC 9110 9.2.1), or the description says so."""
        return self.method in SAFE or self.reads

    def schemas_for(self, status: int) -> dict[str, Schema] | None:
        """Return the schemas by media type for a status; None if the status is not declared."""
        key = self.response_key(status)
        return None if key is None else self.responses[key]

    def response_key(self, status: int) -> str | None:
        """Return the key under which a status is declared: itself, its class or ``default``, or None."""
        keys = (str(status), f"{status // 100}XX", f"{status // 100}xx", "default")
        return next((key for key in keys if key in self.responses), None)

    @cached_property
    def formats(self) -> tuple[str, ...]:
        """The media types of its successful responses, in the description's order."""
        found = [name for status, content in self.responses.items() if status.startswith("2") for name in content]
        return tuple(dict.fromkeys(found))

    @cached_property
    def shape(self) -> Schema | None:
        """The schema of its successful response's body, or what that probably shows, or None."""
        for status, content in self.responses.items():
            if status.startswith("2"):
                for media_type, schema in content.items():
                    if is_json(media_type):
                        return schema or self.guessed or schema
        return None if self.formats else self.guessed

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
    return [_guess(operation, found) for operation in found]


# Names of parameters that order or shape a list, and do not filter it.
_ORDERING: Final = re.compile(r"sort|order|direction|format|view|fields|include|expand|embed", re.IGNORECASE)


def _guess(operation: Operation, operations: Iterable[Operation]) -> Operation:
    """Return a read without a declared content, with the members that writes to the same path take.

    Frameworks such as FastAPI declare `{}` for a function without an annotated response.
    """
    if operation.method != "GET" or operation.shape:
        return operation
    path = operation.template.rstrip("/")
    above, _, last = path.rpartition("/")
    wanted = [("PUT", path), ("PATCH", path), *([("POST", above)] if last.startswith("{") else [])]
    bodies = {(one.method, one.template.rstrip("/")): one.bodies for one in operations}
    # A filter's name and values are those of a member that the device sets.
    lists = (one for one in operations if one.method == "GET" and one.template.rstrip("/") in {path, above})
    queries = (parameter for one in lists for parameter in one.parameter("query"))
    device = {one.name: _without_null(one.schema) for one in queries if not _ORDERING.search(one.name)}
    device = {name: schema for name, schema in device.items() if "enum" in schema}
    own, created = (
        next((body.schema for key in keys for name, body in bodies.get(key, {}).items() if is_json(name)), None)
        for keys in (wanted, [("POST", path)])
    )
    if created is not None and any(template.startswith(f"{path}/{{") for _, template in bodies):
        return replace(operation, guessed={"type": "array", "items": _with(created, device)})
    return operation if own is None else replace(operation, guessed=_with(own, device))


def _without_null(schema: Schema) -> Schema:
    """Return a schema, or its only alternative to null."""
    others = [one for one in schema.get("anyOf", ()) if isinstance(one, dict) and one.get("type") != "null"]
    return others[0] if len(others) == 1 else schema


def _with(schema: Schema, members: dict[str, Schema]) -> Schema:
    """Return the schema of an object with further members."""
    own = schema.get("properties")
    return {**schema, "properties": {**members, **own}} if isinstance(own, dict) and members else schema


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
        # With a contract, every unsafe operation may move the device; with a description alone, only operations marked
        # so.
        motion=bool(given.get("x-roaas-motion", method not in SAFE and not closed)),
        optional=bool(given.get("x-roaas-optional", False)),
        headers={str(status): _headers(response) for status, response in given.get("responses", {}).items()},
        tags=tuple(given.get("tags", ())),
        security=tuple(tuple(alternative) for alternative in given["security"]),
        never=bool(given.get("x-roaas-never", False)),
        stop=bool(given.get("x-roaas-stop", False)),
        reads=bool(given.get("x-roaas-reads", False)),
        created=bool(given.get("x-roaas-created", False)),
        text=" ".join(one for key in ("summary", "description") if isinstance(one := given.get(key), str)),
        conflict=str(given.get("responses", {}).get("409", {}).get("description", "")),
        success=" ".join(
            str(one.get("description", ""))
            for status, one in given.get("responses", {}).items()
            if str(status).startswith("2") and isinstance(one, dict)
        ),
    )


def _answer(schema: Any, *, closed: bool) -> Schema:
    """Return the schema of a response body: unchanged if ``closed``, else without members of requests only."""
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
        marked = _names_marked(properties, mark)
        result["required"] = [name for name in required if name not in marked]
    if isinstance(properties, dict) and mark == "readOnly":
        # A device ignores such a member in a request.
        result["properties"] = {**properties, **{name: {"readOnly": True} for name in _names_marked(properties, mark)}}
    return result


CHANGES.update(readOnly=partial(without_marked, mark="readOnly"), writeOnly=partial(without_marked, mark="writeOnly"))


def _names_marked(properties: dict[str, Any], mark: str) -> set[str]:
    return {name for name, part in properties.items() if isinstance(part, dict) and part.get(mark) is True}


def _headers(response: dict[str, Any]) -> dict[str, tuple[bool, Schema]]:
    """Return the header fields of a response; a schema without a description has the field's."""
    return {
        name.lower(): (
            bool(header.get("required", False)),
            {key: header[key] for key in ("description",) if key in header} | modern(header.get("schema", {})),
        )
        for name, header in response.get("headers", {}).items()
        # OpenAPI 3.1, 4.8.17.1: a Content-Type header in this place is ignored.
        if name.lower() != "content-type"
    }


# A parameter in a path.
PARAMETER = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True)
class Resource:
    """All operations of one path, by method."""

    template: str
    operations: dict[str, Operation]

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        """A regular expression that matches the paths of the template."""
        parts = PARAMETER.split(self.template)
        parts[::2] = map(sendable, parts[::2])
        return re.compile("".join(re.escape(part) if i % 2 == 0 else "[^/]*" for i, part in enumerate(parts)))

    @cached_property
    def methods(self) -> frozenset[str]:
        """The methods that the description declares, and HEAD if it declares GET."""
        given = frozenset(self.operations)
        return given | {"HEAD"} if "GET" in given else given

    @property
    def optional(self) -> bool:
        """Whether a robot need not implement it."""
        return all(operation.optional for operation in self.operations.values())


@lru_cache(maxsize=8)
def resources_of(contract: Contract) -> tuple[Resource, ...]:
    """Return the resources of a contract, in the description's order.

    Raises:
        ContractError: as operations_of().
    """
    by_path: dict[str, dict[str, Operation]] = {}
    for operation in operations_of(contract):
        by_path.setdefault(operation.template, {})[operation.method] = operation
    return tuple(Resource(template, operations) for template, operations in by_path.items())


@lru_cache(maxsize=8)
def _by_place(contract: Contract) -> dict[tuple[int, str], list[Resource]]:
    """Return the resources by how many slashes they have and by their first segment; empty if that is a template."""
    found: dict[tuple[int, str], list[Resource]] = {}
    for item in resources_of(contract):
        found.setdefault(_place(sendable(item.template)), []).append(item)
    return found


def _place(path: str) -> tuple[int, str]:
    first = path.split("/", 2)[1] if "/" in path else path
    return path.count("/"), "" if "{" in first else first


@lru_cache(maxsize=512)
def resource_at(contract: Contract, path: str) -> Resource | None:
    """Return the resource of a path, or None; literal paths precede templates (OpenAPI 3.1, 4.8.8.2)."""
    path, index = sendable(path), _by_place(contract)
    slashes, first = _place(path)
    near = [*index.get((slashes, first), ()), *(index.get((slashes, ""), ()) if first else ())]
    found = [item for item in near if item.pattern.fullmatch(path)]
    return min(found, key=lambda item: item.template.count("{"), default=None)


def matching(contract: Contract, method: str, path: str) -> Operation | None:
    """Return the operation of a request, or None; HEAD counts as GET. ``path`` is below the base URL, without query."""
    resource = resource_at(contract, path)
    return resource.operations.get("GET" if method == "HEAD" else method) if resource else None


def known_path(contract: Contract, path: str) -> bool:
    """Return whether the contract has a resource with this path."""
    return resource_at(contract, path) is not None


@lru_cache(maxsize=512)
def is_normal(path: str) -> bool:
    """Return whether a path has no segment that servers may remove: empty, ``.`` or ``..``."""
    segments = [unquote(segment) for segment in path.split("/")]
    return "" not in segments[1:-1] and not {".", ".."} & set(segments)


def inside_prefix(contract: Contract, path: str) -> bool:
    """Return whether a path begins like the contract's paths; other paths may belong to another server."""
    return path.lstrip("/").split("/", 1)[0] in {
        item.template.lstrip("/").split("/", 1)[0] for item in resources_of(contract)
    }


#: Header parameters that OpenAPI 3 ignores, because other keywords describe them (OpenAPI 3.1, 4.8.12.2).
IGNORED: Final = frozenset({"accept", "content-type", "authorization"})
# Headers by which a server may see another method, target or end of the request than the request line has. They could
# turn a permitted GET into a DELETE, or send a credential to another host behind the same gateway.
_STEERING: Final = re.compile(
    r"x-(?:http-?)?(?:method|verb)(?:-?override)?|(?:http-?)?method-?override"
    r"|(?:x-)?(?:original|rewrite|forwarded)-?(?:url|uri|path|prefix|host|server)"
    r"|x-host|forwarded|host|content-length|transfer-encoding|te|trailer|connection|keep-alive|upgrade|expect"
    r"|proxy-(?:connection|authorization)",
    re.IGNORECASE,
)
_METHOD_IN_QUERY: Final = re.compile(r"_method|_?x?-?http-?method(?:-?override)?|x-method-override", re.IGNORECASE)
_FORM_TYPE: Final = "application/x-www-form-urlencoded"


def with_sent(value: Any, document: Schema, ignored: frozenset[str] = IGNORED) -> Any:
    """Return a part of an OpenAPI 3 document with the parameters that are sent, each by its own name.

    The specification ignores some header parameters. Those by which a request becomes another one are not sent either.
    A query string is written as the parameters in it.

    Args:
        value: the part.
        document: the document.
        ignored: names of header parameters that the specification ignores; Swagger 2.0 ignores none.
    """
    if isinstance(value, list):
        return [with_sent(item, document, ignored) for item in value]
    if not isinstance(value, dict):
        return value
    found = {key: with_sent(item, document, ignored) for key, item in value.items()}
    if isinstance(value.get("parameters"), list):
        found["parameters"] = [sent for one in found["parameters"] for sent in _sent_parameters(one, document, ignored)]
        if _unwritten(value["parameters"], document):
            found["x-roaas-never"] = True
    return found


def _unwritten(parameters: Any, document: Schema) -> str:
    """Return the media type of a required query string that the suite does not write; empty if it writes all."""
    for given in parameters if isinstance(parameters, list) else ():
        one = _follow(given, document)
        if isinstance(one, dict) and one.get("in") == "querystring" and one.get("required") is True:
            content = one.get("content")
            names = " or ".join(content) if isinstance(content, dict) else ""
            return "" if _in_query(one, document) else names or "not described"
    return ""


def not_called(document: Schema) -> tuple[str, ...]:
    """Return a remark for each operation that the suite cannot call."""
    return tuple(
        f"{method} {path} is not called: its query string is {unwritten}, which the suite does not write."
        for path, item in document["paths"].items()
        if isinstance(whole := _follow(item, document), dict)
        for method, one in methods_of(whole).items()
        if isinstance(one, dict) and (unwritten := _unwritten(one.get("parameters"), document))
    )


def unknown_methods(document: Schema) -> Iterator[str]:
    """Yield a remark for each operation below a name that is no method of path items (OpenAPI 3.2, 4.9)."""
    for path, item in document["paths"].items():
        for name, operation in item.items() if isinstance(item, dict) else ():
            if name in _METHODS or name.startswith("x-") or not isinstance(operation, dict):
                continue
            if "responses" in operation:
                lower, more = name.lower(), "only OpenAPI 3.2 describes further methods, in additionalOperations"
                how = f"write {lower!r}" if lower in _METHODS else more
                yield f"{name.upper()} {path} is not called: {name!r} is no method of OpenAPI; {how}."


def _sent_parameters(given: Any, document: Schema, ignored: frozenset[str]) -> list[Any]:
    parameter = _follow(given, document)
    if not isinstance(parameter, dict):
        return [given]
    if parameter.get("in") == "querystring":
        return _in_query(parameter, document)
    name, where = str(parameter.get("name")).lower(), parameter.get("in")
    steers = {"header": _STEERING, "query": _METHOD_IN_QUERY}.get(str(where))
    # Many servers treat _ and - in header names as equal.
    same = name.replace("_", "-") if where == "header" else name
    is_left_out = (where == "header" and name in ignored) or (steers and steers.fullmatch(same))
    return [] if is_left_out else [given]


def _in_query(parameter: Schema, document: Schema) -> list[Schema]:
    """Return the query parameters that a query string consists of (OpenAPI 3.2, 4.12); none if it is no form."""
    content = parameter.get("content")
    media = _follow(content.get(_FORM_TYPE), document) if isinstance(content, dict) else None
    schema = _follow(media.get("schema"), document) if isinstance(media, dict) else None
    properties = schema.get("properties") if isinstance(schema, dict) else None
    required = schema.get("required", ()) if isinstance(schema, dict) and parameter.get("required") is True else ()
    given = media.get("encoding") if isinstance(media, dict) else None
    encoding = given if isinstance(given, dict) else {}
    return [
        {
            "name": name,
            "in": "query",
            "required": name in required,
            "schema": part,
            **{key: one for key, one in encoding.get(name, {}).items() if key in {"style", "explode", "allowReserved"}},
        }
        for name, part in (properties.items() if isinstance(properties, dict) else ())
    ]


def _follow(given: Any, document: Schema) -> Any:
    return (
        target_of(document, given["$ref"]) if isinstance(given, dict) and isinstance(given.get("$ref"), str) else given
    )
