"""A description is read from JSON or YAML, from one file or several, and says where its operations are."""

import json
from pathlib import Path

import pytest

from conformance.documents.description import DescriptionError, read_description
from conformance.documents.json_schema import resolved
from conformance.documents.openapi import read_operations

_HERE = "http://robot:8000/v1/openapi.json"
_PATHS = {"/a": {"get": {"responses": {"200": {"description": ""}}}}}
_REFERRING = {
    "openapi": "3.1.0",
    "paths": {
        "/a": {"$ref": "parts/paths.yaml#/a"},
        "/b": {"get": {"responses": {"200": {"content": {"application/json": {"schema": {"$ref": "b.json"}}}}}}},
    },
    "components": {"schemas": {"Own": {"type": "boolean"}}},
}
_PARTS = {
    "parts/paths.yaml": "a: {get: {responses: {200: {content: {application/json: {schema: {$ref: '#/s'}}}}}}}\n"
    "s: {type: object, properties: {one: {$ref: ../b.json}, two: {$ref: '../main.json#/components/schemas/Own'}}}",
    "b.json": '{"type": "integer"}',
}
_RESOLVED = {"type": "object", "properties": {"one": {"type": "integer"}, "two": {"type": "boolean"}}}


def _loading(files):
    def load(source):
        try:
            return files[source].encode()
        except KeyError:
            raise OSError("no such file") from None

    return load


def _read(text, source=_HERE, overlays=(), **files):
    return read_description(source, _loading({source: text, **files}), overlays)


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"openapi": "3.1.0", "paths": _PATHS}),
        "\ufeff" + json.dumps({"openapi": "3.0.3", "paths": _PATHS}),
        "openapi: 3.0.0\npaths:\n  /a:\n    get:\n      responses:\n        200: {description: ''}\n",
        "swagger: '2.0'\npaths:\n  /a:\n    get:\n      responses:\n        200: {description: ''}\n",
    ],
    ids=["json", "byte order mark", "yaml", "swagger"],
)
def test_each_way_of_writing_gives_the_same_operations(text):
    (operation,) = read_operations(_read(text).document)
    assert (operation.label, list(operation.responses)) == ("GET /a", ["200"])


def test_dates_of_yaml_are_texts():
    text = "openapi: 3.1.0\npaths: {}\nx-day: 2026-01-31\n"
    assert _read(text).document["x-day"] == "2026-01-31"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "cannot be read"),
        ("- a", "a value that is no object"),
        ("a: [", "cannot be read"),
        ("? {a: b}\n: 1", "cannot be read"),
        ('{"paths": {}}', "neither 'openapi"),
        ('{"openapi": "3.1.0"}', "has no 'paths'"),
        ('{"swagger": "2.0", "paths": {"/a": {"get": 1}}}', "no usable Swagger"),
        ("<html>", "no OpenAPI description, but HTML"),
    ],
)
def test_what_is_no_description_says_why(text, why):
    with pytest.raises(DescriptionError, match=why):
        _read(text)


@pytest.mark.parametrize("base", ["http://robot:8000/v1/", ""], ids=["by URL", "by path"])
def test_references_lead_to_other_files(base, tmp_path):
    files = {"main.json": json.dumps(_REFERRING), **_PARTS}
    if base:
        found = read_description(f"{base}main.json", _loading({base + name: text for name, text in files.items()}))
    else:
        (tmp_path / "parts").mkdir()
        for name, text in files.items():
            (tmp_path / name).write_text(text)
        found = read_description(str(tmp_path / "main.json"), lambda source: Path(source).read_bytes())
    assert found.unresolved == ()
    a, b = read_operations(found.document)
    assert (a.shape, b.shape) == (_RESOLVED, {"type": "integer"})


@pytest.mark.parametrize("reference", ["#/gone", "gone.json#/a", "http://elsewhere:1/a.json", "file:///etc/passwd"])
def test_a_reference_to_what_cannot_be_fetched_is_named(reference):
    document = {"openapi": "3.1.0", "paths": _PATHS, "components": {"schemas": {"A": {"$ref": reference}}}}
    found = _read(json.dumps(document))
    assert [text.split(":")[0] for text in found.unresolved] == [reference.split(":")[0]]
    assert found.document["components"]["schemas"]["A"] == {}


def test_pointers_go_into_lists_and_are_percent_decoded():
    document = {"a/{b}": [{"type": "string"}]}
    assert resolved(document, {"$ref": "#/a~1%7Bb%7D/0"}) == {"type": "string"}


@pytest.mark.parametrize(
    ("source", "said", "base", "remarked"),
    [
        (_HERE, {}, "http://robot:8000", False),
        (_HERE, {"servers": [{"url": "/api/"}]}, "http://robot:8000/api", False),
        (_HERE, {"servers": [{"url": "."}]}, "http://robot:8000/v1", False),
        (
            _HERE,
            {"servers": [{"url": "{s}://robot:8000/v2", "variables": {"s": {"default": "http"}}}]},
            "http://robot:8000/v2",
            False,
        ),
        (_HERE, {"servers": [{"url": "http://a/x"}, {"url": "http://robot:8000/y"}]}, "http://robot:8000/y", False),
        (_HERE, {"servers": [{"url": "https://cloud.example/api"}]}, "http://robot:8000/api", True),
        ("d.json", {"servers": [{"url": "http://robot:1/x/"}]}, "http://robot:1/x", False),
        ("d.json", {"servers": [{"url": "/x"}]}, "", False),
        ("d.json", {}, "", False),
    ],
)  # fmt: skip
def test_the_base_url_follows_from_servers_and_source(source, said, base, remarked):
    found = _read(json.dumps({"openapi": "3.1.0", "paths": _PATHS, **said}), source)
    assert (found.base_url, bool(found.remarks)) == (base, remarked)


@pytest.mark.parametrize("url", ["/\ud800", "//\ud800/a", "http://a:\ud800/a", "/{v}"])
@pytest.mark.parametrize("source", ["a.json", "http://device.invalid/a.json"])
def test_a_server_that_no_text_can_hold_is_read(url: str, source: str) -> None:
    servers = [{"url": url, "variables": {"v": {"default": "\ud800"}}}]
    assert _read(json.dumps({"openapi": "3.1.0", "paths": _PATHS, "servers": servers}), source).base_url.isascii()


@pytest.mark.parametrize(
    ("source", "said", "base"),
    [
        ("https://robot/swagger.json", {"host": "robot", "basePath": "/v2"}, "https://robot/v2"),
        ("https://robot/swagger.json", {"host": "robot", "schemes": ["http", "https"]}, "https://robot"),
        ("http://robot/swagger.json", {"basePath": "/v2"}, "http://robot/v2"),
        ("d.json", {"host": "robot:1", "basePath": "/v2"}, "http://robot:1/v2"),
    ],
)
def test_the_base_url_of_swagger(source, said, base):
    assert _read(json.dumps({"swagger": "2.0", "paths": _PATHS, **said}), source).base_url == base


def test_overlays_are_applied_in_their_order():
    overlays = {
        name: json.dumps({"overlay": "1.0.0", "actions": [{"target": "$.paths['/a'].get", "update": {"x-n": name}}]})
        for name in ("one", "two")
    }
    found = _read(json.dumps({"openapi": "3.1.0", "paths": _PATHS}), overlays=("one", "two"), **overlays)
    assert found.document["paths"]["/a"]["get"]["x-n"] == "two"
    assert "x-n" not in found.original["paths"]["/a"]["get"]


@pytest.mark.parametrize("version", ["openapi: 3.0.3", "openapi: 3.1.0", "swagger: '2.0'"])
def test_header_parameters_that_other_keywords_describe_are_ignored_in_openapi_3(version):
    text = f"""
{version}
paths:
  /a:
    parameters: [{{name: AUTHORIZATION, in: header, type: string, schema: {{}}}}]
    get:
      parameters:
        - $ref: '#/components/parameters/Accept'
        - {{name: content-type, in: header, type: string, schema: {{}}}}
        - {{name: accept, in: query, type: string, schema: {{}}}}
        - {{name: X-Trace, in: header, type: string, schema: {{}}}}
      responses: {{200: {{description: ''}}}}
components:
  parameters:
    Accept: {{name: Accept, in: header, type: string, schema: {{}}}}
"""
    (operation,) = read_operations(_read(text).document)
    names = [item.name for item in operation.parameters]
    kept = ["accept", "X-Trace"]
    assert names == (["AUTHORIZATION", "Accept", "content-type", *kept] if "swagger" in version else kept)


def test_a_read_without_declared_content_shows_what_is_written_there():
    target = {"type": "object", "properties": {"x": {"type": "number"}}}
    takes = {"requestBody": {"content": {"application/json": {"schema": target}}}, "responses": {"201": {}}}
    shows = {"responses": {"200": {"description": "", "content": {"application/json": {"schema": {}}}}}}
    text = {"responses": {"200": {"description": "", "content": {"text/plain": {}}}}}
    states = {"type": "string", "enum": ["queued", "done"]}
    filter_ = {"name": "status", "in": "query", "schema": {"anyOf": [states, {"type": "null"}]}}
    sort = {"name": "sort", "in": "query", "schema": {"enum": ["x", "id"]}}
    shown = {"type": "object", "properties": {"status": states, "x": {"type": "number"}}}
    paths = {
        "/targets": {"get": {**shows, "parameters": [filter_, sort]}, "post": takes},
        "/targets/{id}": {"get": {"responses": {"200": {"description": ""}}}, "delete": {"responses": {"204": {}}}},
        "/limits": {"get": shows, "put": takes},
        "/search": {"get": shows, "post": takes},
        "/name": {"get": text, "put": takes},
    }
    found = {one.label: one for one in read_operations({"openapi": "3.1.0", "paths": paths})}
    shapes = {label: one.shape for label, one in found.items() if label.startswith("GET")}
    assert shapes == {
        "GET /targets": {"type": "array", "items": shown},
        "GET /targets/{id}": shown,
        "GET /limits": target,
        "GET /search": {},
        "GET /name": None,
    }
    assert found["GET /targets"].responses["200"]["application/json"] == {}, "nothing is judged by it"
