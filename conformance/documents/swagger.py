"""Convert a Swagger 2.0 description to OpenAPI 3.0."""

from __future__ import annotations

from typing import Any

from conformance.documents.json_schema import Schema, target_of

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
# By collectionFormat: style and explode of OpenAPI 3.
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
