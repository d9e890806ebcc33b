"""Parameters are read back as OpenAPI's tables of styles have them; what the tables leave open is unclear."""

import json

import pytest

from conformance.documents.description import read_description
from conformance.documents.openapi import Body, read_operations
from conformance.documents.parameter_reading import (
    decoded_path,
    judge_texts,
    multipart_verdict,
    query_verdicts,
    urlencoded_verdict,
)
from conformance.documents.parameters import Encoding, Parameter
from conformance.documents.writing import header_text, multipart_body, path_text, query_pairs, query_text

_WHOLE = {"type": "integer", "minimum": 0}
_LIST = {"type": "array", "items": _WHOLE, "minItems": 1, "maxItems": 3}
_POINT = {"type": "object", "required": ["x"], "properties": {"x": {"type": "number"}, "y": {"type": "number"}}}
_TAG = {
    "type": "object",
    "required": ["min"],
    "additionalProperties": False,
    "properties": {"min": _WHOLE, "tag": {"enum": ["a", "b"]}},
}
_BODY = Body(
    "",
    {
        "type": "object",
        "required": ["map"],
        "properties": {
            "map": {"type": "string", "format": "binary"},
            "name": {"type": "string"},
            "n": _WHOLE,
            "files": {"type": "array", "items": {"type": "string", "format": "binary"}, "maxItems": 2},
            "pose": _POINT,
        },
    },
)


@pytest.mark.parametrize(
    ("style", "explode", "schema", "texts"),
    [
        ("simple", False, _WHOLE, {"0": "valid", "-1": "invalid", "abc": "invalid", "1.0": "unclear"}),
        ("matrix", False, _WHOLE, {";p=0": "valid", ";p=-1": "invalid", "0": "unclear", ";q=0": "unclear"}),
        ("label", False, _WHOLE, {".0": "valid", ".-1": "invalid", "0": "unclear"}),
        ("simple", False, _LIST, {"1,2": "valid", "1": "valid", "1,2,3,4": "invalid", "1,a": "invalid", "": "unclear"}),
        ("simple", False, _LIST, {"1%2C2": "unclear", "1,%zz": "unclear", "%C3": "unclear"}),
        ("label", True, _LIST, {".1.2": "valid", ".1.a": "invalid"}),
        ("label", False, _LIST, {".1": "valid", ".1,2": "unclear", ".a": "invalid"}),
        ("matrix", False, _LIST, {";p=1,2": "valid", ";p=-1": "invalid"}),
        ("matrix", True, _LIST, {";p=1;p=2": "valid", ";p=-1": "invalid", ";q=1": "unclear"}),
        ("simple", False, _POINT, {"x,1,y,2": "valid", "y,2": "invalid", "x,a": "invalid", "x,1,z": "unclear"}),
        ("simple", True, _POINT, {"x=1,y=2": "valid", "y=2": "invalid", "x": "invalid", "x=1,z=a%2Cb": "unclear"}),
        ("label", True, _POINT, {".x=1": "valid", ".y=1": "invalid"}),
        ("matrix", True, _POINT, {";x=1;y=2": "valid", ";y=2": "invalid"}),
        ("matrix", False, _POINT, {";p=x,1": "valid", ";p=y,2": "invalid"}),
        ("simple", False, {"type": "boolean"}, {"true": "valid", "True": "unclear", "1": "unclear", "abc": "invalid"}),
    ],
)
def test_paths(style, explode, schema, texts):
    item = Parameter("p", "path", required=True, schema=schema, style=style, explode=explode)
    assert {text: judge_texts(item, [text], decoded_path) for text in texts} == texts


@pytest.mark.parametrize(
    ("schema", "more", "queries"),
    [
        (_LIST, {}, {"p=1&p=2": "valid", "p=1": "valid", "p=a": "invalid", "p=1,2": "unclear", "": "valid"}),
        (_LIST, {"explode": False}, {"p=1,2": "valid", "p=a": "invalid", "p=1,2,3,4": "invalid", "p=1&p=2": "unclear"}),
        (_LIST, {"style": "pipeDelimited"}, {"p=1%7C2": "valid", "p=1|2": "valid", "p=a%7C2": "invalid"}),
        (_LIST, {"style": "spaceDelimited"}, {"p=1%202": "valid", "p=1+2": "valid", "p=-1": "invalid"}),
        (_LIST, {"style": "tabDelimited"}, {"p=1%092": "valid", "p=-1%092": "invalid"}),
        (_LIST, {"required": True}, {"": "invalid"}),
        ({"type": "array"}, {"required": True}, {"": "valid"}),
        (_POINT, {}, {"x=1&y=2": "valid", "y=2": "invalid", "x=1&z=%5B%5D": "valid", "z=1": "unclear", "": "valid"}),
        (_POINT, {"required": True}, {"": "invalid"}),
        (_POINT, {"explode": False}, {"p=x,1": "valid", "p=y,1": "invalid", "p=x,1,foo,%5B%5D": "valid"}),
        (_TAG, {"style": "deepObject"}, {"p%5Bmin%5D=1": "valid", "p[min]=1&p[tag]=b": "valid", "p[tag]=a": "invalid"}),
        (_TAG, {"style": "deepObject"}, {"p[min]=1&p[w]=1": "invalid", "p[min][a]=1": "unclear", "": "valid"}),
        (_POINT, {"media_type": "application/json"}, {"p=%7B%22x%22:1%7D": "valid", "p=%7B%7D": "invalid"}),
        (_POINT, {"media_type": "application/json"}, {"p=%7B": "invalid", "p=%7B%22x%22:NaN%7D": "unclear"}),
        ({"anyOf": [{"type": "string"}, {"type": "array"}]}, {}, {"p=a": "valid", "p=a&p=b": "valid"}),
        (_WHOLE, {"empty": True}, {"p=": "unclear"}),
        (
            {"type": "string", "format": "uuid"},
            {},
            {"p=0": "unclear", "p=3fa85f64-5717-4562-b3fc-2c963f66afa6": "valid"},
        ),
        ({"type": "string", "enum": ["a"]}, {}, {"p=a": "valid", "p=b": "invalid", "q=b": "unclear"}),
    ],
)
def test_queries(schema, more, queries):
    explode = more.get("explode", more.get("style", "form") == "form")
    item = Parameter("p", "query", **{"required": False, "schema": schema, "style": "form", **more, "explode": explode})

    def verdict(query):
        said = {one for one, _, _ in query_verdicts([item], query)}
        return next(one for one in ("unclear", "invalid", "valid") if one in said)

    assert {query: verdict(query) for query in queries} == queries


@pytest.mark.parametrize("explode", [False, True])
@pytest.mark.parametrize(("schema", "value"), [(_WHOLE, 7), (_LIST, [1, 2]), (_POINT, {"x": 1, "y": -2})])
def test_what_is_written_is_read_back_as_valid(schema, value, explode):
    for style in ("simple", "matrix", "label"):
        item = Parameter("p", "path", required=True, schema=schema, style=style, explode=explode)
        is_open = style == "label" and not explode and schema is not _WHOLE
        expected = "unclear" if is_open else "valid"
        assert judge_texts(item, [path_text(value, style, "p", explode=explode)], decoded_path) == expected
    header = Parameter("p", "header", required=True, schema=schema, explode=explode)
    assert judge_texts(header, [header_text(value, explode=explode)]) == "valid"
    for style in ("form",) if explode else ("form", "pipeDelimited", "spaceDelimited", "tabDelimited"):
        item = Parameter("p", "query", required=True, schema=schema, style=style, explode=explode)
        query = query_text(query_pairs("p", value, style, explode=explode))
        assert [said for said, _, _ in query_verdicts([item], query)] == ["valid"]


@pytest.mark.parametrize(
    ("fields", "verdict"),
    [
        ({"map": b"\x00\xff"}, "valid"),
        ({"map": b"x", "name": None}, "unclear"),
        ({"map": b"x", "name": "null"}, "valid"),
        ({"map": b"x", "name": "\x00\x1f"}, "valid"),
        ({"map": b"x", "n": 3, "more": "a"}, "valid"),
        ({"map": b"x", "n": "a"}, "invalid"),
        ({"map": b"x", "pose": {"x": 1}}, "valid"),
        ({"map": b"x", "pose": {"y": 1}}, "invalid"),
        ({"map": b"x", "files": [b"a", b"b"]}, "valid"),
        ({"map": b"x", "files": [b"a", b"b", b"c"]}, "invalid"),
        ({"map": "text"}, "unclear"),
        ({"name": "x"}, "invalid"),
        ({"map": b"x", 'a"b\r\n': "y"}, "valid"),
    ],
)
def test_multipart(fields, verdict):
    content_type, body = multipart_body(fields)
    assert multipart_verdict(body, content_type, _BODY)[0] == verdict


@pytest.mark.parametrize("content_type", ["multipart/form-data", "multipart/form-data; boundary=other"])
def test_what_is_no_multipart_body_is_unclear(content_type):
    assert multipart_verdict(b"--b\r\n\r\nx\r\n--b--", content_type, _BODY)[0] == "unclear"


def test_the_encoding_says_what_a_part_is():
    how = {"pose": Encoding(media_type="application/json"), "map": Encoding(media_type="image/png")}
    _, body = multipart_body({"map": b"x", "pose": [1, 2]}, how)
    assert b"Content-Type: image/png\r\n\r\nx" in body
    assert b"Content-Type: application/json\r\n\r\n[1, 2]" in body


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        (b"n=1&tags=a&tags=b", "valid"),
        (b"n=a", "invalid"),
        (b"tags=a", "invalid"),
        (b"n=1&ids=1,2", "valid"),
        (b"n=1&ids=1,a", "invalid"),
        (b"n=1&free=x", "valid"),
        (b"n=1&n=2", "unclear"),
        (b"\xff", "unclear"),
    ],
)
def test_urlencoded(text, verdict):
    properties = {"n": _WHOLE, "tags": {"type": "array"}, "ids": {"type": "array", "items": _WHOLE}}
    schema = {"type": "object", "required": ["n"], "properties": properties}
    form = Body("", schema, encoding={"ids": Encoding("form", explode=False)})
    assert urlencoded_verdict(text, form)[0] == verdict


_FORM = "application/x-www-form-urlencoded"
_SCHEMA = {"type": "object", "required": ["n"], "properties": {"n": {"type": "integer"}, "ids": {"type": "array"}}}


def _read(content, *, required=True, **components):
    parameter = {"name": "q", "in": "querystring", "required": required, "content": content}
    paths = {"/t": {"get": {"parameters": [{"$ref": "#/components/parameters/Q"}], "responses": {}}}}
    document = {
        "openapi": "3.2.0", "info": {}, "paths": paths, "components": {"parameters": {"Q": parameter}, **components}
    }  # fmt: skip
    return read_description("http://device.invalid/o.json", lambda _: json.dumps(document).encode())


@pytest.mark.parametrize("schema", [_SCHEMA, {"$ref": "#/components/schemas/S"}])
@pytest.mark.parametrize("required", [True, False])
def test_a_form_is_read_as_query_parameters(schema, required):
    content = {_FORM: {"schema": schema, "encoding": {"ids": {"style": "pipeDelimited", "explode": False}}}}
    read = _read(content, required=required, schemas={"S": _SCHEMA})
    whole, ids = read_operations(read.document)[0].parameters
    assert (whole.name, whole.where, whole.required, whole.explode) == ("n", "query", required, True)
    assert (ids.name, ids.required, ids.style, ids.explode) == ("ids", False, "pipeDelimited", False)
    assert read.not_called == ()


def test_an_operation_whose_query_string_cannot_be_written_is_named_and_not_called():
    read = _read({"application/jsonpath": {"schema": {"type": "string"}}})
    assert read.not_called == (
        "GET /t is not called: its query string is application/jsonpath, which the suite does not write.",
    )
    assert read_operations(read.document)[0].never


@pytest.mark.parametrize("version", [{"openapi": "3.0.3"}, {"swagger": "2.0"}], ids=str)
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("get", ()),
        ("x-own", ()),
        ("PROPFIND", ("PROPFIND /t is not called: 'PROPFIND' is no method of OpenAPI; only OpenAPI 3.2",)),
        ("lock", ("LOCK /t is not called: 'lock' is no method of OpenAPI; only OpenAPI 3.2",)),
        ("GET", ("GET /t is not called: 'GET' is no method of OpenAPI; write 'get'.",)),
    ],
)
def test_an_operation_below_another_name_than_a_methods_is_told(version, name, said):
    document = {**version, "info": {}, "paths": {"/t": {name: {"responses": {}}, "parameters": []}}}
    read = read_description("http://device.invalid/o.json", lambda _: json.dumps(document).encode())
    assert [remark.partition(" describes")[0] for remark in read.not_called] == [*said]
