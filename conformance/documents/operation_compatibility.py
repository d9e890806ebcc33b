"""Compare two descriptions of an API by operation: which changes break old clients, and which do not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final
from urllib.parse import urlsplit

from conformance.documents.json_schema import Schema, kinds_of, modern, target_of
from conformance.documents.openapi import IGNORED, PARAMETER, methods_of
from conformance.documents.parameters import Parameter, by_media_type, read_encoding, read_parameter
from conformance.documents.schema_compatibility import schema_changes
from conformance.documents.schema_sides import Side

#: Whether a change breaks a client (None: not known), and the text of the change.
Found = tuple[bool | None, str]
_KINDS: Final = {"query": "query parameter", "header": "header", "cookie": "cookie", "path": "path parameter"}
# Parameter styles with a prefix before a single value.
_MARKED: Final = frozenset({"matrix", "label"})


@dataclass
class Documents:
    """Two documents, and the schemas in them by direction."""

    old: Schema
    new: Schema
    sides: dict[tuple[bool, bool], tuple[Side, Side]] = field(default_factory=dict)

    def schema_changes(self, old: Any, new: Any, *, request: bool, media_type: str = "") -> Iterator[Found]:
        """Yield the changes from a schema of the old document to one of the new."""
        key = request, "xml" in media_type
        if key not in self.sides:
            self.sides[key] = (
                Side("old", self.old, request=request, media_type=media_type),
                Side("new", self.new, request=request, media_type=media_type),
            )
        one, other = self.sides[key]
        for change in schema_changes((one.schema(old), one), (other.schema(new), other), request=request):
            yield change.breaks, change.text


@dataclass(frozen=True)
class Described:
    """An operation as a description has it.

    Attributes:
        document: that it is in.
        path: its template.
        item: the path item, without a reference.
        operation: the operation of it.
    """

    document: Schema
    path: str
    item: Schema
    operation: Schema

    def follow(self, value: Any) -> Any:
        """Return a value, or the target if it is a reference."""
        for _ in range(8):
            if not (isinstance(value, dict) and isinstance(value.get("$ref"), str)):
                break
            value = target_of(self.document, value["$ref"])
        return value if isinstance(value, dict) else {}

    def parameters(self) -> dict[tuple[str, str], tuple[Parameter, Any]]:
        """Return the parameters with their schemas; those of the path by their place, headers in lower case."""
        names = PARAMETER.findall(self.path)
        found: dict[tuple[str, str], tuple[Parameter, Any]] = {}
        for item in [*self.item.get("parameters", ()), *self.operation.get("parameters", ())]:
            given = self.follow(item)
            parameter = read_parameter({**given, "schema": {}})
            name, where = parameter.name, parameter.where
            if (where == "header" and name.lower() in IGNORED) or (where == "path" and name not in names):
                continue
            content: Any = next(iter(given.get("content", {}).values()), {})
            key = str(names.index(name)) if where == "path" else name.lower() if where == "header" else name
            found[where, key] = parameter, given.get("schema", content.get("schema", {}))
        return found


def operation_changes(both: Documents, old: Described, new: Described, *, by_client: bool = True) -> Iterator[Found]:
    """Yield the changes between two versions of an operation, and whether each breaks a client.

    Args:
        both: the two documents.
        old: the older operation.
        new: the newer one.
        by_client: whether clients send the request; otherwise the API sends it, as in a webhook.
    """
    comparison = _Comparison(both, old, new, by_client)
    yield from comparison.parameters()
    yield from comparison.body()
    yield from comparison.responses()


@dataclass
class _Comparison:
    both: Documents
    old: Described
    new: Described
    by_client: bool

    def parameters(self) -> Iterator[Found]:
        before, after = self.old.parameters(), self.new.parameters()
        for key, (one, _) in after.items():
            if key not in before and one.where == "path":
                # The parameter always existed: only its description is new.
                yield False, f"{_name_of(one)} is described now"
            elif key not in before:
                needed = one.required and self.by_client
                yield needed, f"{_name_of(one)} is new{', and required' if one.required else ''}"
        for key, (one, schema) in before.items():
            if key not in after:
                path = one.where == "path"
                yield not path, f"{_name_of(one)} is {'no longer described' if path else 'gone'}"
                continue
            other, its_schema = after[key]
            if one.required != other.required:
                word = "required" if other.required else "optional"
                yield other.required == self.by_client, f"{_name_of(one)} is {word} now"
            yield from self._compare_style(one, other, schema, its_schema)
            for breaks, text in self.both.schema_changes(schema, its_schema, request=self.by_client):
                yield breaks, f"{_name_of(one)}{text}"

    def _compare_style(self, one: Parameter, other: Parameter, schema: Any, its_schema: Any) -> Iterator[Found]:
        """Yield changes of how a parameter is written. A single value is written alike in most styles."""
        kinds = _kinds(schema, self.old) | _kinds(its_schema, self.new)
        composed = not kinds or bool(kinds & {"array", "object"})
        ways = [
            (each.style, each.explode, each.media_type)
            if composed
            else (each.style if each.style in _MARKED else "", False, each.media_type)
            for each in (one, other)
        ]
        if ways[0] != ways[1]:
            yield True, f"{_name_of(one)} is written in another way (style, explode or content)"
        for word, had, has in (
            ("reserved characters", one.reserved, other.reserved),
            ("no value", one.empty, other.empty),
        ):
            if had != has:
                yield has != self.by_client, f"{_name_of(one)} may {'now' if has else 'no longer'} have {word}"

    def body(self) -> Iterator[Found]:
        before, after = (operation.follow(operation.operation.get("requestBody")) for operation in (self.old, self.new))
        old, new = by_media_type(before), by_media_type(after)
        word = "takes" if self.by_client else "has"
        needed, needs = (bool(item.get("required", False)) for item in (before, after))
        if old and not new:
            yield True, f"{word} no body any more"
            return
        if not old:
            if new:
                yield needs and self.by_client, f"{word} a body{', which is required' if needs else ''}"
            return
        if needed != needs:
            yield needs == self.by_client, f"the body is {'required' if needs else 'optional'} now"
        yield from self._contents("the body", old, new, request=self.by_client)

    def responses(self) -> Iterator[Found]:
        before, after = (
            {str(key).upper().replace("DEFAULT", "default"): operation.follow(value) for key, value in given.items()}
            for operation in (self.old, self.new)
            for given in (operation.operation.get("responses") or {},)
        )
        pairs: dict[tuple[str, str], None] = {}
        for status in before:
            keys = [status] if status in after else _narrower(status, before, after) or _wider(status, after)
            if not keys:
                # A client needs no error status that is no longer described.
                succeeds = status.startswith("2") or not any(key.startswith("2") for key in before)
                yield succeeds, f"status {status} is gone"
            pairs |= dict.fromkeys((status, key) for key in keys)
        for status in after:
            if status not in before:
                yield False, f"status {status} is new"
                pairs |= dict.fromkeys((key, status) for key in _wider(status, before))
        for status, key in pairs:
            contents = by_media_type(before[status]), by_media_type(after[key])
            yield from self._contents(f"response {status}", *contents, request=not self.by_client)
            yield from self._headers(f"response {status}", before[status], after[key])

    def _headers(self, what: str, before: Schema, after: Schema) -> Iterator[Found]:
        old, new = (
            {
                name.lower(): described.follow(header)
                for name, header in response.get("headers", {}).items()
                if name.lower() != "content-type"
            }
            for described, response in ((self.old, before), (self.new, after))
        )
        for name, header in old.items():
            if name not in new:
                yield True, f"{what}, header {name} is gone"
                continue
            if bool(header.get("required")) != bool(new[name].get("required")):
                is_needed = bool(new[name].get("required"))
                yield (
                    is_needed != self.by_client,
                    f"{what}, header {name} is {'required' if is_needed else 'optional'} now",
                )
            schemas = [_schema_of(item) for item in (header, new[name])]
            for breaks, text in self.both.schema_changes(*schemas, request=not self.by_client):
                yield breaks, f"{what}, header {name}{text}"
        for name in new:
            if name not in old:
                needed = not self.by_client and bool(new[name].get("required"))
                yield needed, f"{what}, header {name} is new"

    def _contents(self, what: str, old: Schema, new: Schema, *, request: bool) -> Iterator[Found]:
        """Yield the changes in the media types of a body, and in the schema of each."""
        found: dict[Found, None] = {}
        for name, content in old.items():
            # A client that sends a described media type must be understood; a client that reads accepts less than a
            # whole range.
            others = [one for one in new if _is_in(name, one)][:1] or [one for one in new if _is_in(one, name)]
            if not others or (request and not _is_in(name, others[0])):
                yield True, f"{what} is no longer {name}"
            for other in others:
                for breaks, text in self._content(content, new[other], name, request=request):
                    found[breaks, f"{what}{text}"] = None
        yield from found
        for name in new:
            if name not in old and (old or not request):
                # A response may gain content: a client that expects none ignores it.
                yield False, f"{what} may be {name}"

    def _content(self, old: Schema, new: Schema, media_type: str, *, request: bool) -> Iterator[Found]:
        schemas = [_of_text(_schema_of(item), media_type) for item in (old, new)]
        yield from self.both.schema_changes(*schemas, request=request, media_type=media_type)
        if _is_form(media_type) and read_encoding(old) != read_encoding(new):
            yield None, ": not compared: encoding"


def _narrower(status: str, before: Schema, after: Schema) -> list[str]:
    """Return the new statuses of a range or of ``default`` that is gone."""
    found = [key for key in after if key not in before and status in _covering(key)]
    return [] if status.isdigit() else found


def _wider(status: str, known: Schema) -> list[str]:
    """Return the range or ``default`` that covers a status, the nearer one."""
    return [key for key in _covering(status) if key in known][:1]


def _covering(status: str) -> tuple[str, ...]:
    if status == "default":
        return ()
    return (f"{status[0]}XX", "default") if status.isdigit() else ("default",)


def _is_in(media_type: str, range_: str) -> bool:
    return range_ in {media_type, "*/*", f"{media_type.partition('/')[0]}/*"}


def _is_form(media_type: str) -> bool:
    return media_type.startswith("multipart/") or media_type == "application/x-www-form-urlencoded"


def _schema_of(given: Schema) -> Any:
    if "itemSchema" in given:
        return {"type": "array", "items": given["itemSchema"]}
    content: Any = next(iter(given.get("content", {}).values()), {})
    return given.get("schema", content.get("schema", {}))


def _of_text(schema: Any, media_type: str) -> Any:
    """Return the schema of a body; a body that is neither JSON, XML nor a form is a text."""
    structured = "json" in media_type or "xml" in media_type or "*" in media_type or _is_form(media_type)
    if structured or not isinstance(schema, dict) or schema.keys() - {"format", "contentMediaType", "contentEncoding"}:
        return schema
    return {**schema, "type": "string"}


def _kinds(schema: Any, described: Described) -> frozenset[str]:
    found = modern(described.follow(schema) if isinstance(schema, dict) else {})
    return kinds_of(found)


def _name_of(parameter: Parameter) -> str:
    return f"{_KINDS.get(parameter.where, parameter.where)} {parameter.name}"


# Members of a security scheme that a client must know, by the scheme's type.
_KNOWN: Final = {"apiKey": ("in", "name"), "http": ("scheme",), "openIdConnect": ("openIdConnectUrl",)}
# A credential as a client knows it, with its scopes. Several may be needed together.
_Alternative = dict[tuple[str, ...], frozenset[str]]


def security_changes(old: tuple[Schema, Schema], new: tuple[Schema, Schema]) -> Iterator[tuple[bool, str]]:
    """Yield the changes in the credentials that an operation needs, and whether each breaks a client.

    Args:
        old: the document and the operation.
        new: likewise.
    """
    before, after = _alternatives(*old), _alternatives(*new)
    if all(item in after for item in before) and all(item in before for item in after):
        yield from _flows(old[0], new[0], before)
        return
    # Credentials that sufficed before must still suffice.
    breaking = any(not any(_suffices(had, needed) for needed in after) for had in before)
    yield breaking, f"needs {_text(*new)}, before {_text(*old)}"


def _suffices(had: _Alternative, needed: _Alternative) -> bool:
    return all(scheme in had and scopes <= had[scheme] for scheme, scopes in needed.items())


def _security_of(document: Schema, operation: Schema) -> list[Schema]:
    """Return the alternatives of an operation: without one, no credentials are needed."""
    return operation.get("security", document.get("security")) or [{}]


def _schemes(document: Schema) -> Schema:
    found: Schema = document.get("components", {}).get("securitySchemes", {})
    return found


def _alternatives(document: Schema, operation: Schema) -> list[_Alternative]:
    schemes = _schemes(document)
    return [
        {_scheme_of(name, schemes.get(name)): frozenset(scopes) for name, scopes in item.items()}
        for item in _security_of(document, operation)
    ]


def _scheme_of(name: str, scheme: Any) -> tuple[str, ...]:
    """Return a security scheme as a client sees it, whatever its name; the name if it is not described."""
    kind = scheme.get("type") if isinstance(scheme, dict) else None
    if kind not in {*_KNOWN, "oauth2", "mutualTLS"}:
        return (name,)
    known = tuple(str(scheme.get(key, "")) for key in _KNOWN.get(kind, ()))
    # Header fields and the names of schemes are the same in any case (RFC 9110, 5.1 and 11.1).
    blind = kind == "http" or known[:1] == ("header",)
    return (kind, *(text.lower() if blind else text for text in known))


def _flows(old: Schema, new: Schema, demanded: list[_Alternative]) -> Iterator[tuple[bool, str]]:
    """Yield the ways to an OAuth token that are gone or lead elsewhere."""
    if not any(("oauth2",) in item for item in demanded):
        return
    before, after = (
        {
            (kind, key, str(flow[key]))
            for scheme in _schemes(document).values()
            if isinstance(scheme, dict) and scheme.get("type") == "oauth2"
            for kind, flow in scheme.get("flows", {}).items()
            for key in ("tokenUrl", "authorizationUrl")
            if key in flow
        }
        for document in (old, new)
    )
    for kind, key, url in sorted(before - after):
        yield True, f"the {key} {url} of the OAuth flow {kind} is gone"
    for kind, key, url in sorted(after - before):
        yield False, f"the {key} {url} of the OAuth flow {kind} is new"


def _text(document: Schema, operation: Schema) -> str:
    return " or ".join(
        " with ".join(f"{name} ({', '.join(scopes)})" if scopes else name for name, scopes in item.items())
        or "no credentials"
        for item in _security_of(document, operation)
    )


_VARIABLE: Final = re.compile(r"\{([^{}]+)\}")
# Method and path below the server.
_Key = tuple[str, str]


@dataclass(frozen=True)
class Change:
    """A change of a description.

    Attributes:
        breaking: whether a client of the older description may fail; None if it is not known.
        operation: method and path, or the whole if empty.
        text: what changed.
    """

    breaking: bool | None
    operation: str
    text: str


def changes(old: Schema, new: Schema) -> list[Change]:
    """Return the changes between two OpenAPI 3 documents: breaking ones, possibly breaking ones, and the rest.

    Raises:
        UnresolvedError, AttributeError, TypeError, KeyError: a document is malformed.
    """
    both = Documents(old, new)
    found = list(_of_operations(both, *(_operations(document, "paths") for document in (old, new))))
    webhooks = [_operations(document, "webhooks") for document in (old, new)]
    found += _of_operations(both, *webhooks, by_client=False)
    order = {True: 0, None: 1, False: 2}
    return sorted(dict.fromkeys(found), key=lambda change: order[change.breaking])


def _of_operations(
    both: Documents, before: dict[_Key, Described], after: dict[_Key, Described], *, by_client: bool = True
) -> Iterator[Change]:
    what = "operation" if by_client else "message"
    for key, item in before.items():
        if key not in after:
            yield Change(breaking=True, operation=_label(key, item), text=f"the {what} is gone")
    known = {id(item.operation) for key, item in after.items() if key in before}
    for key, item in after.items():
        if id(item.operation) not in known:
            yield Change(breaking=False, operation=_label(key, item), text=f"the {what} is new")
    compared = set()
    for key, item in before.items():
        other = after.get(key)
        if other is not None and (id(item.operation), id(other.operation)) not in compared:
            compared.add((id(item.operation), id(other.operation)))
            for breaks, text in _of_operation(both, item, other, by_client=by_client):
                yield Change(breaks, _label(key, item), text)


def _label(key: _Key, item: Described) -> str:
    return f"{key[0]} {item.path}"


def _of_operation(both: Documents, old: Described, new: Described, *, by_client: bool) -> Iterator[Found]:
    if by_client:
        yield from security_changes((both.old, old.operation), (both.new, new.operation))
    yield from operation_changes(both, old, new, by_client=by_client)
    # Callbacks are requests from the API to the client.
    callbacks = _callbacks(old), _callbacks(new)
    for change in _of_operations(both, *callbacks, by_client=not by_client):
        yield change.breaking, f"callback {change.operation}: {change.text}"


def _operations(document: Schema, section: str) -> dict[_Key, Described]:
    """Return the operations by method and path below each server, in which the names of parameters do not count."""
    whole = Described(document, "", {}, {})
    found: dict[_Key, Described] = {}
    for path, given in (document.get(section) or {}).items():
        if not isinstance(given, dict):
            raise TypeError(f"the path {path} has no object")
        item = whole.follow(given)
        for method, operation in methods_of(item).items():
            servers = operation.get("servers") or item.get("servers") or document.get("servers")
            bases = [_base(server) for server in servers or [Schema()]] if section == "paths" else [""]
            for base in bases:
                found[method, base + PARAMETER.sub("{}", path)] = Described(document, path, item, operation)
    return found


def _callbacks(described: Described) -> dict[_Key, Described]:
    return {
        (method, str(expression)): Described(described.document, str(expression), item, operation)
        for callback in described.operation.get("callbacks", {}).values()
        for expression, given in described.follow(callback).items()
        if not str(expression).startswith("x-")
        for item in (described.follow(given),)
        for method, operation in methods_of(item).items()
    }


def _base(server: Schema) -> str:
    """Return the path of a server's URL, with the defaults of its variables."""
    variables = server.get("variables", {})
    url = _VARIABLE.sub(lambda found: str(variables.get(found[1], {}).get("default", "")), str(server.get("url", "")))
    return urlsplit(url).path.rstrip("/")
