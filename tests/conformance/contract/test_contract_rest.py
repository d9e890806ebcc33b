"""The contract's descriptions of REST: its OpenAPI is valid and has all of Table 1, and its WADL names the same."""

import pytest
from openapi_spec_validator import OpenAPIV31SpecValidator

from conformance.api.rest.description import described_by_wadl, differences
from conformance.contract.pack import Contract
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import operations_of
from conformance.documents.representation import from_element, parse_xml

CONTRACT = Contract.load()
TAKING = [item for item in operations_of(CONTRACT) if item.bodies]
DELIVERY = (
    "/robot/app/delivery/{code}/depot_x/{depot_x}/depot_y/{depot_y}"
    "/dest_x/{dest_x}/dest_y/{dest_y}/source_x/{source_x}/source_y/{source_y}"
)
TABLE_1 = {
    "/robot/pose/": {"GET"},
    "/robot/velocity/": {"GET", "PUT"},
    "/robot/velocity/linear/": {"GET", "PUT"},
    "/robot/sensors/": {"GET"},
    "/robot/navigation/services/": {"GET"},
    "/robot/navigation/action/goal/": {"GET", "PUT", "DELETE"},
    "/robot/navigation/service/plan": {"GET"},
    DELIVERY: {"PUT"},
}


def test_it_is_valid_openapi_3_1():
    assert CONTRACT.openapi["openapi"].startswith("3.1.")
    OpenAPIV31SpecValidator(CONTRACT.openapi).validate()


@pytest.mark.parametrize(("path", "methods"), TABLE_1.items())
def test_table_1_is_there(path, methods):
    assert {item.method for item in operations_of(CONTRACT) if item.template == path} == methods


def test_every_unsafe_operation_moves_and_every_safe_one_does_not():
    assert all(item.motion != item.safe for item in operations_of(CONTRACT))


def test_operation_ids_are_unique():
    ids = [item.id for item in operations_of(CONTRACT)]
    assert len(set(ids)) == len(ids)


@pytest.mark.parametrize("operation", TAKING, ids=lambda item: item.id)
def test_examples_of_bodies_are_valid_and_say_the_same(operation):
    plain, xml = operation.bodies["application/json"], operation.bodies["application/xml"]
    for value, text in zip(plain.examples, xml.examples, strict=True):
        assert not shape_of(plain.schema).problem(value)
        assert from_element(parse_xml(text.encode()), xml.schema) == value


def test_examples_of_parameters_are_valid():
    for operation in operations_of(CONTRACT):
        for parameter in operation.parameters:
            for value in parameter.examples:
                assert not shape_of(parameter.schema).problem(value)


def test_reads_come_in_three_formats_and_errors_as_problems():
    for operation in operations_of(CONTRACT):
        if operation.method == "GET":
            assert operation.formats == ("application/json", "application/xml", "text/plain")
        for status, content in operation.responses.items():
            if status.startswith(("4", "5")):
                assert set(content) == {"application/problem+json", "application/problem+xml"}


def test_openapi_and_wadl_agree():
    wadl = described_by_wadl(CONTRACT.wadl_path.read_bytes(), "http://127.0.0.1:7003")

    def seen(item):
        return item.method, item.template, frozenset((one.where, one.name, one.required) for one in item.parameters)

    assert differences(operations_of(CONTRACT), wadl) == []
    assert {seen(item.operation) for item in wadl} == {seen(item) for item in operations_of(CONTRACT)}
