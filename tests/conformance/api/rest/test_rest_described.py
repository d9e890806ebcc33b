import copy

import pytest

from conformance.api.rest.description import described_by_openapi, described_by_wadl, differences
from conformance.contract.pack import Contract
from conformance.documents.description_faults import openapi_fault
from conformance.documents.openapi import operations_of
from conformance.documents.representation import UnreadableError

CONTRACT = Contract.load()
BASE = "http://robot:7003"


def _differences(document, base=BASE):
    return differences(operations_of(CONTRACT), described_by_openapi(document, base))


def test_the_contract_describes_itself():
    assert openapi_fault(CONTRACT.openapi) == ""
    assert _differences(CONTRACT.openapi) == []


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda paths: paths.pop("/robot/pose/"), "no GET /robot/pose/"),
        (lambda paths: paths["/robot/velocity/"].pop("put"), "no PUT /robot/velocity/"),
        (lambda paths: paths["/robot/navigation/service/plan"]["get"]["parameters"].pop(2), "parameter yaw"),
        (
            lambda paths: paths["/robot/navigation/service/plan"]["get"]["parameters"][0].pop("required"),
            "with the parameter x as optional",
        ),
        (
            lambda paths: paths["/robot/navigation/service/plan"]["get"]["parameters"][4]["schema"].update(default=0.5),
            "the default 0.5 of the parameter tolerance instead of 0.1",
        ),
        (lambda paths: paths.update({"/robot/sensors": paths.pop("/robot/sensors/")}), "no GET /robot/sensors/"),
    ],
)
def test_what_is_missing_is_named(change, expected):
    document = copy.deepcopy(CONTRACT.openapi)
    change(document["paths"])
    assert expected in "; ".join(_differences(document))


def test_a_wadl_has_the_defaults_of_the_contract():
    document = CONTRACT.wadl_path.read_bytes()
    other = document.replace(b'default="0.1"', b'default="0.10001"')
    assert differences(operations_of(CONTRACT), described_by_wadl(document, BASE)) == []
    assert "'0.10001'" in "".join(differences(operations_of(CONTRACT), described_by_wadl(other, BASE)))


def test_freedoms_of_a_description():
    document = copy.deepcopy(CONTRACT.openapi)
    paths = document["paths"]
    del paths["/robot/app/delivery/"]
    paths["/robot/dance/"] = {"post": {"responses": {"204": {"description": "Danced."}}}}
    document["paths"] = {f"/v1{path}": item for path, item in paths.items()}
    assert _differences(document, f"{BASE}/v1") == []
    document["paths"] = paths
    document["servers"] = [{"url": "https://gate.example/v1"}]
    assert _differences(document, f"{BASE}/v1") == []


@pytest.mark.parametrize(
    "document",
    [
        None,
        [],
        {"openapi": "2.0", "paths": {}},
        {"openapi": "3.1.0", "paths": {}},
        {"openapi": "3.1.0", "info": {"title": "t", "version": "1"}, "paths": {"pose": {}}},
        {
            "openapi": "3.1.0",
            "info": {"title": "t", "version": "1"},
            "paths": {"/a/{b}": {"get": {"responses": {"200": {"description": "d"}}}}},
        },
        {
            "openapi": "3.1.0",
            "info": {"title": "t", "version": "1"},
            "paths": {"/a": {"get": {"responses": {"200": {"$ref": "#/components/responses/Gone"}}}}},
        },
    ],
)
def test_descriptions_that_are_none(document):
    assert openapi_fault(document)


def test_wadl_of_the_contract_and_a_nested_one():
    wadl = CONTRACT.wadl_path.read_bytes()
    assert differences(operations_of(CONTRACT), described_by_wadl(wadl, BASE)) == []
    nested = b"""<application xmlns="http://wadl.dev.java.net/2009/02"><resources base="http://robot:7003/api/">
      <resource path="/robot"><resource path="pose/"><method href="#get"/></resource>
      <resource path="app/{code: [0-9]+}"><param name="code" style="template"/><method name="PUT"/></resource>
      </resource></resources><method id="get" name="GET"/></application>"""
    found = described_by_wadl(nested, f"{BASE}/api")
    assert [(item.operation.method, item.path) for item in found] == [
        ("GET", "/robot/pose/"),
        ("PUT", "/robot/app/{code}"),
    ]
    (code,) = found[1].operation.parameters
    assert (code.where, code.name, code.required) == ("path", "code", True)


@pytest.mark.parametrize("body", [b"", b"<a/>", b"no"])
def test_what_is_no_wadl(body):
    with pytest.raises(UnreadableError):
        described_by_wadl(body, BASE)
