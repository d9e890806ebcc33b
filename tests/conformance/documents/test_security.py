"""Which parameters of a description carry credentials, and which operations demand some."""

import pytest

from conformance.documents.openapi import read_operations
from conformance.documents.security import demands, is_http_authentication, without_credentials

_SCHEMES = {
    "bearer": {"type": "http", "scheme": "bearer"},
    "open": {"type": "openIdConnect", "openIdConnectUrl": "/id"},
    "key": {"type": "apiKey", "in": "header", "name": "X-Key"},
    "query": {"type": "apiKey", "in": "query", "name": "key"},
    "certificate": {"type": "mutualTLS"},
}


def _document(security, own=(), **members):
    operation = {"responses": {"200": {"description": "ok"}}, "security": security, "parameters": list(own)}
    return {"paths": {"/a": {"get": operation, **members}}, "components": {"securitySchemes": _SCHEMES}}


@pytest.mark.parametrize(
    ("security", "demanded", "by_http"),
    [
        ([], False, False),
        ([{}], False, False),
        ([{"bearer": []}], True, True),
        ([{"open": ["read"]}], True, True),
        ([{"key": []}], True, False),
        ([{"bearer": []}, {"key": []}], True, False),
        ([{"bearer": [], "key": []}], True, True),
        ([{"bearer": []}, {}], False, False),
        ([{"certificate": []}], False, False),
        ([{"certificate": [], "key": []}], True, False),
        ([{"certificate": []}, {"key": []}], False, False),
        ([{"unknown": []}], True, False),
    ],
)
def test_an_operation_demands_credentials_if_no_alternative_is_without(security, demanded, by_http):
    document = _document(security)
    (operation,) = read_operations(document)
    assert (demands(document, operation), is_http_authentication(document, operation)) == (demanded, by_http)


def _named(where, name):
    return {"in": where, "name": name, "schema": {}}


@pytest.mark.parametrize(
    ("security", "given", "left"),
    [
        ([{"key": []}], (), ["Authorization", "key", "X-Token"]),
        ([{"query": []}, {"bearer": []}], (), ["x-key", "X-Token"]),
        ([], (), ["x-key", "Authorization", "key", "X-Token"]),
        ([], (("header", "x-token"),), ["x-key", "Authorization", "key"]),
    ],
)
def test_a_parameter_is_a_credential_where_a_scheme_of_the_operation_or_the_run_names_it(security, given, left):
    shared = [_named("header", "x-key"), {"$ref": "#/components/parameters/A"}]
    document = _document(security, [_named("query", "key"), _named("header", "X-Token")], parameters=shared)
    document["components"]["parameters"] = {"A": _named("header", "Authorization")}
    item = without_credentials(document, given)["paths"]["/a"]
    read = {"#/components/parameters/A": "Authorization"}
    names = [one.get("name") or read[one["$ref"]] for one in item["parameters"] + item["get"]["parameters"]]
    assert names == left
