"""Read the description of an API: OpenAPI 3.2, 3.1, 3.0 or Swagger 2.0, as JSON or YAML, in one file or several.

An OpenAPI Overlay (OAI Overlay Specification 1.0 and 1.1) changes it as it is read.
"""

from __future__ import annotations

import copy
import html
import json
import re
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from os.path import normpath
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote, urlsplit

from conformance.commandline.device_options import advice
from conformance.contract.document_text import parsed
from conformance.documents.description_faults import dead_references, reason, type_faults, without_unreadable
from conformance.documents.json_schema import Schema, UnresolvedError, target_of
from conformance.documents.openapi import not_called, unknown_methods, with_sent
from conformance.documents.schema_budget import crowd_in, long_text_in
from conformance.documents.schema_places import DATA, FILES, in_one_version, make_plain
from conformance.transport.reach import ElsewhereError, Trust, is_same, joined, path_of

_METHODS = ("get", "put", "post", "delete", "patch", "head", "options")
_FORM = "application/x-www-form-urlencoded"
_MULTIPART = "multipart/form-data"
_JSON = ("application/json",)
# Keys of a parameter or header that OpenAPI 3 moves into its schema.
_OF_SCHEMA = frozenset(
    {
        "type", "format", "items", "default", "maximum", "exclusiveMaximum", "minimum", "exclusiveMinimum", "maxLength",
        "minLength", "pattern", "maxItems", "minItems", "uniqueItems", "enum", "multipleOf", "x-nullable",
    }
)  # fmt: skip
_MOVED = {
    "#/definitions/": "#/components/schemas/",
    "#/parameters/": "#/components/parameters/",
    "#/responses/": "#/components/responses/",
}
# Style and explode of OpenAPI 3 for each collectionFormat of Swagger 2.0.
_COLLECTIONS = {
    "csv": ("form", False),
    "ssv": ("spaceDelimited", False),
    "tsv": ("tabDelimited", False),
    "pipes": ("pipeDelimited", False),
    "multi": ("form", True),
}


def as_openapi_3(document: Schema) -> Schema:
    """Return a Swagger 2.0 description as OpenAPI 3.0.

    Raises:
        UnresolvedError: a ``$ref`` of a parameter or response leads nowhere.
        AttributeError, TypeError, KeyError: the document is malformed.
    """
    schemes = document.get("securityDefinitions", {})
    components = {
        "schemas": _as_openapi_3(document.get("definitions", {})),
        "securitySchemes": {name: _scheme(scheme) for name, scheme in schemes.items()},
    }
    found: Schema = {"openapi": "3.0.3", "info": document.get("info", {}), "components": components}
    if servers := _servers(document):
        found["servers"] = servers
    found |= {key: document[key] for key in ("security", "tags") if key in document}
    found["paths"] = {
        path: _path_item(document, item) for path, item in document.get("paths", {}).items() if path.startswith("/")
    }
    return found | {key: _as_openapi_3(value) for key, value in document.items() if key.startswith("x-")}


def _servers(document: Schema) -> list[Schema]:
    host, base = document.get("host"), document.get("basePath", "")
    if not host:
        return [{"url": base}] if base else []
    # Without `schemes`, use the scheme by which the description was fetched.
    schemes = [f"{scheme}:" for scheme in document.get("schemes", ())] or [""]
    return [{"url": f"{scheme}//{host}{base}"} for scheme in schemes]


def _scheme(given: Schema) -> Schema:
    if given.get("type") == "basic":
        return {"type": "http", "scheme": "basic"}
    return dict(given)


def _path_item(document: Schema, item: Schema) -> Schema:
    item = _follow(document, item)
    shared = [_follow(document, one) for one in item.get("parameters", [])]
    found = {key: value for key, value in item.items() if key.startswith("x-")}
    for method in _METHODS:
        if method in item:
            found[method] = _operation(document, item[method], shared)
    return found


def _follow(document: Schema, value: Schema) -> Schema:
    found: Schema = target_of(document, value["$ref"]) if "$ref" in value else value
    return found


def _operation(document: Schema, given: Schema, shared: list[Schema]) -> Schema:
    own = [_follow(document, item) for item in given.get("parameters", [])]
    names = {(item["name"], item["in"]) for item in own}
    parameters = [item for item in shared if (item["name"], item["in"]) not in names] + own
    consumes = given.get("consumes", document.get("consumes", _JSON))
    produces = given.get("produces", document.get("produces", _JSON))
    found = {
        key: value for key, value in given.items() if key not in {"parameters", "responses", "consumes", "produces"}
    }
    found["parameters"] = [
        _parameter(parameter) for parameter in parameters if parameter["in"] not in {"body", "formData"}
    ]
    body = next((parameter for parameter in parameters if parameter["in"] == "body"), None)
    form = [parameter for parameter in parameters if parameter["in"] == "formData"]
    if body is not None:
        content = {name: {"schema": _as_openapi_3(body.get("schema", {}))} for name in consumes or _JSON}
        found["requestBody"] = {"required": body.get("required", False), "content": content}
    elif form:
        found["requestBody"] = _form(form, consumes)
    found["responses"] = {
        str(status): _response(_follow(document, response), produces)
        for status, response in given.get("responses", {}).items()
        if not str(status).startswith("x-")
    }
    return found


def _schema_of(given: Schema) -> Schema:
    """Return the schema that stands beside the name of a parameter or header."""
    schema = {key: value for key, value in given.items() if key in _OF_SCHEMA}
    if schema.get("type") == "file":
        schema |= {"type": "string", "format": "binary"}
    renamed: Schema = _as_openapi_3(schema)
    return renamed


def _parameter(given: Schema) -> Schema:
    found = {key: value for key, value in given.items() if key not in _OF_SCHEMA and key != "collectionFormat"}
    found["schema"] = _schema_of(given)
    if given.get("type") == "array":
        written = _collection(given)
        # In paths and headers, commas are the style simple; OpenAPI 3 has no name for the other separators.
        found |= {**written, "style": "simple"} if given["in"] in {"path", "header"} and _is_csv(given) else written
    if "x-example" in given:
        found["example"] = given["x-example"]
    return found


def _is_csv(given: Schema) -> bool:
    return given.get("collectionFormat", "csv") in {"csv", "multi"}


def _collection(given: Schema) -> Schema:
    style, explode = _COLLECTIONS.get(given.get("collectionFormat", "csv"), ("form", False))
    return {"style": style, "explode": explode}


def _form(fields: list[Schema], consumes: Any) -> Schema:
    is_multipart = any(field.get("type") == "file" for field in fields) or (
        _MULTIPART in consumes and _FORM not in consumes
    )
    schema = {
        "type": "object",
        "properties": {str(field["name"]): _schema_of(field) for field in fields},
        "required": [str(field["name"]) for field in fields if field.get("required")],
    }
    encoding = {str(field["name"]): _collection(field) for field in fields if field.get("type") == "array"}
    return {
        "required": bool(schema["required"]),
        "content": {_MULTIPART if is_multipart else _FORM: {"schema": schema, "encoding": encoding}},
    }


def _response(given: Schema, produces: Any) -> Schema:
    found = {key: value for key, value in given.items() if key == "description" or key.startswith("x-")}
    if "schema" in given:
        schema = given["schema"]
        is_file = schema.get("type") == "file"
        plain = {"type": "string", "format": "binary"} if is_file else _as_openapi_3(schema)
        examples = given.get("examples", {})
        found["content"] = {
            name: {"schema": plain, **({"example": examples[name]} if name in examples else {})}
            for name in (produces or _JSON)
        }
    found["headers"] = {name: {"schema": _schema_of(header)} for name, header in given.get("headers", {}).items()}
    return found


def _as_openapi_3(value: Any) -> Any:
    """Return a schema with references to where OpenAPI 3 keeps their targets, and ``nullable``."""
    if isinstance(value, list):
        return [_as_openapi_3(item) for item in value]
    if not isinstance(value, dict):
        return value
    found = {key: _as_openapi_3(item) for key, item in value.items()}
    if isinstance(found.get("$ref"), str):
        for old, new in _MOVED.items():
            found["$ref"] = found["$ref"].replace(old, new, 1)
    if found.pop("x-nullable", None) is True:
        found["nullable"] = True
    return found


# Limits for all files of a description together: number, bytes, and time to fetch them, s.
_MOST_FILES: Final = 5_000
_MOST_OCTETS: Final = 64 * 1024 * 1024
_MOST_S: Final = 120.0
# Objects whose keys are names that an author chose.
_BY_NAME: Final = frozenset(
    {
        "properties", "patternProperties", "dependentSchemas", "dependencies", "$defs", "definitions", "schemas",
        "responses", "parameters", "examples", "requestBodies", "headers", "securitySchemes", "links", "callbacks",
        "pathItems", "paths", "webhooks", "content", "encoding", "mediaTypes",
    }
)  # fmt: skip
_TITLE: Final = re.compile(r"<title[^>]{0,200}>([^<]{1,500})", re.IGNORECASE)
_TITLE_WITHIN: Final = 20_000
_VARIABLE: Final = re.compile(r"\{([^{}]+)\}")
_SERVER: Final = re.compile(r"(?:[A-Za-z][A-Za-z0-9+.-]*:)?//[^/?#]*")
_BLANK: Final = b"\xef\xbb\xbf \t\r\n"
_SCHEME: Final = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")
# Returns the content of a URL or file.
Load = Callable[[str], bytes]


class DescriptionError(ValueError):
    """Raised for a description that cannot be used; the message names the file and the fault."""


@dataclass(frozen=True)
class Description:
    """The description of an API.

    Attributes:
        source: URL or path that it was read from.
        document: as one OpenAPI 3 document, with the overlays applied.
        original: as it was read.
        base_url: absolute URL below which the operations are; empty if the description does not say it.
        unresolved: each reference to another file that leads nowhere, with the reason.
        remarks: what a reader of the result should know about its server.
        not_called: what the suite cannot call, with the reason.
        unread: operations and schemas that cannot be read and are left out of the document, and references that are not
            followed, because they lead to another server or out of the folder; each with the reason.
        elsewhere: that it was found at another place than the user named.
    """

    source: str
    document: Schema
    original: Schema
    base_url: str
    unresolved: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    not_called: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    elsewhere: tuple[str, ...] = ()


def read_description(source: str, load: Load, overlays: Iterable[str] = (), trust: Trust | None = None) -> Description:
    """Return the description at a URL or in a file.

    Args:
        source: URL or path.
        load: returns the content of a URL or file; its errors are OSError or ValueError.
        overlays: URLs or paths of OpenAPI Overlay documents, applied in this order.
        trust: the servers that the description may name; by default that of a URL.

    Raises:
        DescriptionError: it cannot be read, or is neither OpenAPI 3 nor Swagger 2.0.
    """
    try:
        return _description(source, _within_budget(load), overlays, trust or Trust.of(source))
    except RecursionError as error:
        raise DescriptionError(f"{source} cannot be read: it is nested too deeply") from error


def _description(source: str, load: Load, overlays: Iterable[str], trust: Trust) -> Description:
    original = _parse(source, load)
    bundle = _Bundle(source, load)
    document = bundle.with_files(original)
    for overlay in overlays:
        try:
            document = overlaid(document, _parse(overlay, load))
        except OverlayError as error:
            raise DescriptionError(f"{overlay}: {error}") from error
    version = str(original.get("openapi") or original.get("swagger") or "")
    strange = tuple(unknown_methods(document)) if isinstance(document.get("paths"), dict) else ()
    if version.startswith("2."):
        try:
            document = as_openapi_3(document)
        except (UnresolvedError, AttributeError, TypeError, KeyError) as error:
            why = reason(error, type_faults(original), ())
            raise DescriptionError(f"{source} is no usable Swagger 2.0 description: {why}") from error
    elif not version.startswith("3."):
        raise DescriptionError(f"{source} is no OpenAPI description: it has neither 'openapi: 3...' nor 'swagger: 2.0'")
    if not isinstance(document.get("paths"), dict):
        raise DescriptionError(f"{source} describes no operation: it has no 'paths'")
    if excess := crowd_in(document) or long_text_in(document):
        raise DescriptionError(f"{source} cannot be read with its overlays: {excess}")
    broken = dead_references(document)
    document = _without(document, frozenset(broken)) if broken else document
    uncalled = strange
    if version.startswith("2."):
        document = with_sent(document, document, frozenset())
    else:
        uncalled, document = (*uncalled, *not_called(document)), with_sent(document, document)
    document, unread = without_unreadable(in_one_version(document), original)
    base_url, remarks = _base_url(source, document, trust)
    references = (*bundle.unresolved, *broken)
    left_out = (*unread, *bundle.refused)
    return Description(source, document, original, base_url, references, remarks, uncalled, left_out)


def _without(value: Any, broken: frozenset[str]) -> Any:
    """Return a value without broken references, so that the rest can be used."""
    if isinstance(value, list):
        return [_without(item, broken) for item in value if not _refers(item, broken)]
    if not isinstance(value, dict):
        return value
    return {key: {} if _refers(item, broken) else _without(item, broken) for key, item in value.items()}


def _is_reference(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(value.get("$ref"), str)


def _refers(value: Any, broken: frozenset[str]) -> bool:
    return _is_reference(value) and value["$ref"] in broken


def is_url(source: str, *, bridge: bool = False) -> bool:
    """Return whether a source is an HTTP URL, or with ``bridge`` that of a WebSocket, rather than a file."""
    return source.lower().startswith(("http://", "https://", *(("ws://", "wss://") if bridge else ())))


def _parse(source: str, load: Load) -> Schema:
    """Return the object in a JSON or YAML file.

    Raises:
        DescriptionError: it cannot be read.
    """
    octets = b""
    try:
        octets = load(source)
        document = parsed(octets, urlsplit(source).path if is_url(source) else source)
    except (OSError, ValueError) as error:
        if not octets.lstrip(_BLANK).startswith(b"<"):
            raise DescriptionError(f"{source} cannot be read: {error}") from error
        document = None
    if not isinstance(document, dict):
        markup = octets.lstrip(_BLANK).startswith(b"<")
        what = _markup(octets) if markup else "a value that is no object"
        raise DescriptionError(f"{source} is no OpenAPI description, but {what}")
    if excess := crowd_in(document) or long_text_in(document):
        raise DescriptionError(f"{source} cannot be read: {excess}")
    return document


def _markup(octets: bytes) -> str:
    """Return what a document is that begins with `<`: an HTML page with its title, or XML."""
    beginning = octets[:_TITLE_WITHIN].decode("utf-8", "replace")
    title = _TITLE.search(beginning)
    if title:
        return f"an HTML page with the title {' '.join(html.unescape(title[1]).split())[:80]!r}"
    return "HTML, such as a page for people" if "<html" in beginning.lower() else "HTML or XML, such as a WSDL"


def _within_budget(load: Load) -> Load:
    """Return a function that loads as `load` does, until a description's files are too many octets or take too long."""
    left, until = _MOST_OCTETS, time.monotonic() + _MOST_S

    def load_within(source: str) -> bytes:
        nonlocal left
        if left < 0 or time.monotonic() > until:
            limit = f"{_MOST_OCTETS:,} bytes" if left < 0 else f"{_MOST_S:g} s"
            raise ValueError(f"the limit of a description's files is {limit}")
        octets = load(source)
        left -= len(octets)
        return octets

    return load_within


@dataclass
class _Bundle:
    """Makes one document of a description in several files."""

    source: str
    load: Load
    numbers: dict[str, str] = field(default_factory=dict)
    anchors: dict[str, dict[str, str]] = field(default_factory=dict)
    files: dict[str, Any] = field(default_factory=dict)
    unresolved: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)

    def with_files(self, document: Schema) -> Schema:
        """Return the document with all files it refers to merged below FILES, and with references to there."""
        plain = json.loads(json.dumps(document))
        self.anchors[self.source] = make_plain(plain, self.source)
        plain.pop("jsonSchemaDialect", None)  # a schema of any dialect is judged as JSON Schema 2020-12, OpenAPI's own
        whole: Schema = self._copy(plain, self.source, "#")
        return {**whole, FILES: self.files} if self.files else whole

    def _copy(self, value: Any, location: str, root: str, *, by_name: bool = False) -> Any:
        if isinstance(value, list):
            return [self._copy(item, location, root) for item in value]
        if not isinstance(value, dict):
            return value
        found = {
            key: item
            if key in DATA and key != "examples" and not by_name
            else self._copy(item, location, root, by_name=key in _BY_NAME and not by_name)
            for key, item in value.items()
        }
        if isinstance(value.get("$ref"), str):
            reference = self._moved_reference(value["$ref"], location, root)
            if reference is None:
                return {}
            found["$ref"] = reference
        return found

    def _moved_reference(self, reference: str, location: str, root: str) -> str | None:
        """Return a reference to another file as one within the whole document; None if the file cannot be read."""
        file, _, pointer = reference.partition("#")
        if not file:
            return f"{root}{self._pointer(location, pointer)}"
        target = file if is_url(file) else joined(location, file)
        if not is_url(location) and not is_url(file):
            target = file if _SCHEME.match(file) else normpath(Path(location).parent / file)
        if target == (self.source if is_url(self.source) else normpath(self.source)):
            return f"#{self._pointer(self.source, pointer)}"
        if target not in self.numbers:
            if len(self.numbers) >= _MOST_FILES:
                self.unresolved.append(f"{reference}: it is not read (the limit is {_MOST_FILES:,} files)")
                return None
            number = self.numbers[target] = str(len(self.numbers))
            try:
                other = _parse(target, self.load)
            except DescriptionError as error:
                if isinstance(error.__cause__, ElsewhereError):
                    self.refused.append(f"The reference {reference} is not followed: {error.__cause__}.")
                else:
                    self.unresolved.append(f"{reference}: {error}")
            else:
                self.files[number] = {}
                self.anchors[target] = make_plain(other, target)
                self.files[number] = self._copy(other, target, f"#/{FILES}/{number}")
        if self.numbers[target] not in self.files:
            return None
        return f"#/{FILES}/{self.numbers[target]}{self._pointer(target, pointer)}"

    def _pointer(self, location: str, fragment: str) -> str:
        """Return a fragment as a JSON pointer: one that is an anchor's name is looked up in its file."""
        return self.anchors.get(location, {}).get(fragment, fragment)


def _base_url(source: str, document: Schema, trust: Trust) -> tuple[str, tuple[str, ...]]:
    """Return the URL below which the operations are, and a remark where the description names another server."""
    given = document.get("servers")
    servers = [item for item in given if isinstance(item, dict)] if isinstance(given, list) else []
    urls = [_with_defaults(server) for server in servers] or ["/"]
    if not is_url(source):
        wholes = [f"http:{url}" if url.startswith("//") else url for url in urls]
        return next(filter(is_url, wholes), "").rstrip("/"), ()
    wholes = [joined(source, url) for url in urls]
    known = [text for text in wholes if is_same(text, source)] or [text for text in wholes if trust.trusts(text)]
    if known:
        return trust.place(known[0]).partition("?")[0].rstrip("/"), ()
    here = f"{urlsplit(source).scheme}://{urlsplit(source).netloc}{path_of(wholes[0])}".rstrip("/")
    remark = f"The description names the server {wholes[0]}. Tested was {here}, from where it was read"
    return here, (f"{remark}{advice('; --base-url changes that')}.",)


def _with_defaults(server: Schema) -> str:
    """Return a server's URL with the defaults of its variables, percent-encoded where a path must be."""
    given = server.get("variables")
    variables = given if isinstance(given, dict) else {}

    def default(found: re.Match[str]) -> str:
        variable = variables.get(found[1], {})
        return str(variable.get("default", "")) if isinstance(variable, dict) else ""

    url = _VARIABLE.sub(default, str(server.get("url", "/")))
    server_part = _SERVER.match(url)
    begin = server_part.end() if server_part else 0
    # A request target may not contain a space, line end or lone surrogate, and a host no lone surrogate.
    host = url[:begin].encode("utf-8", "backslashreplace").decode()
    return host + quote(url[begin:], safe="%/:?#[]@!$&'()*+,;=~\\", errors="surrogatepass")


# Limits for an overlay: places that its actions change, values that they add, and time, s.
_MOST_PLACES: Final = 50_000
_MOST_NODES: Final = 1_000_000
_MOST_OVERLAY_S: Final = 10.0


class OverlayError(ValueError):
    """Raised for an overlay that cannot be applied; the message names the action and the fault."""


def overlaid(document: Schema, overlay: Schema) -> Schema:
    """Return a copy of a description with an overlay's actions applied in their order.

    Raises:
        OverlayError: the overlay is malformed, or an action has no valid JSONPath (RFC 9535).
    """
    # Imported late: it takes a twentieth of a second, and few descriptions have an overlay.
    import jsonpath  # noqa: PLC0415
    from jsonpath.exceptions import JSONPathError  # noqa: PLC0415

    if "overlay" not in overlay or not isinstance(overlay.get("actions"), list):
        raise OverlayError("it is no overlay: it needs 'overlay' and a list of 'actions'")
    changed = copy.deepcopy(document)
    places = nodes = 0
    until = time.monotonic() + _MOST_OVERLAY_S
    for number, action in enumerate(overlay["actions"]):
        if not isinstance(action, dict) or not isinstance(action.get("target"), str):
            raise OverlayError(f"actions[{number}] has no 'target'")
        size = _size(action.get("update"))
        try:
            matches = []
            for match in jsonpath.finditer(action["target"], changed):
                places, nodes = places + 1, nodes + size
                if places > _MOST_PLACES or nodes > _MOST_NODES or time.monotonic() > until:
                    limits = f"{_MOST_PLACES:,} places, {_MOST_NODES:,} values and {_MOST_OVERLAY_S:g} s"
                    raise OverlayError(f"actions[{number}] goes beyond the limit of an overlay: {limits}")  # noqa: TRY301 - within the loop
                matches.append(match)
        except OverlayError:
            raise
        # jsonpath uses Python's numbers and patterns, which raise these
        except (JSONPathError, ValueError, OverflowError, re.error) as error:
            raise OverlayError(f"actions[{number}] target {action['target']!r} is no JSONPath: {error}") from error
        # From the last to the first, so that removing an item of a list does not move the next.
        for match in reversed(matches):
            _apply(changed, list(match.parts), action)
    return changed


def _size(value: Any) -> int:
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + sum(map(_size, parts))


def _apply(document: Schema, parts: list[Any], action: Schema) -> None:
    parent: Any = document
    for part in parts[:-1]:
        parent = parent[part]
    if action.get("remove") is True:
        if parts:
            del parent[parts[-1]]
        return
    update = action.get("update")
    here = parent[parts[-1]] if parts else document
    if isinstance(here, list):
        here.append(copy.deepcopy(update))
    elif isinstance(here, dict) and isinstance(update, dict):
        _merge(here, update)
    elif parts:
        parent[parts[-1]] = copy.deepcopy(update)


def _merge(here: dict[str, Any], update: dict[str, Any]) -> None:
    """Merge an object into another one: objects member by member, lists joined, everything else replaced."""
    for key, value in update.items():
        if isinstance(value, dict) and isinstance(here.get(key), dict):
            _merge(here[key], value)
        elif isinstance(value, list) and isinstance(here.get(key), list):
            here[key] = [*here[key], *copy.deepcopy(value)]
        else:
            here[key] = copy.deepcopy(value)
