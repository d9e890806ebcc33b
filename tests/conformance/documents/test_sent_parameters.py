"""Query strings of OpenAPI 3.2 are read as the parameters in them."""

import json

import pytest

from conformance.documents.description import read_description
from conformance.documents.openapi import read_operations

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
