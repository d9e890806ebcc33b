"""The contract's WSDLs, XSD, OpenAPI and WADL are valid, have all of the paper, and name the same."""

import re

import pytest
import xmlschema
from lxml import etree
from openapi_spec_validator import OpenAPIV31SpecValidator
from zeep import Client

from conformance.api.rest.description import described_by_wadl, differences
from conformance.contract.pack import Contract
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import operations_of
from conformance.documents.representation import from_element, parse_xml
from conformance.papers_robot import delivery
from conformance.papers_robot.delivery import XSD_FIELDS
from conformance.papers_robot.statement import CONTRACT_DIR

NAMESPACE = "http://soap.turtlebot.mybot.org/"
WSDL = "{http://schemas.xmlsoap.org/wsdl/}"
READS = {"GetPose", "GetVelocity", "GetSensors", "GetNavigationServices", "GetGoal", "GetPlan"}
SERVICES = {
    "publishers": ("TurtlebotPublishers", {"ExecuteCoffeeRequest", "ExecuteDeliveryRequest"}),
    "subscribers": ("TurtlebotSubscribers", READS),
}


@pytest.fixture(params=SERVICES)
def described(request):
    name = request.param
    return CONTRACT_DIR / f"{name}.wsdl", *SERVICES[name]


def test_zeep_loads_it(described):
    path, name, operations = described
    client = Client(str(path))
    service = client.wsdl.services[f"{name}WebServiceService"]
    assert set(service.ports) == {f"{name}WebServicePort"}
    port = service.ports[f"{name}WebServicePort"]
    assert set(port.binding.all()) == operations
    assert port.binding.port_type.name.localname == f"{name}Interface"


def test_names_are_those_of_the_paper(described):
    path, name, operations = described
    root = etree.parse(path).getroot()
    assert root.get("targetNamespace") == NAMESPACE
    assert root.find(f"{WSDL}binding").get("name") == f"{name}WebServicePortBinding"
    for operation in operations:
        for suffix in ("", "Response"):
            parts = root.findall(f"{WSDL}message[@name='{operation}{suffix}']/{WSDL}part")
            assert [(part.get("name"), part.get("element")) for part in parts] == [
                ("parameters", f"tns:{operation}{suffix}")
            ]


@pytest.mark.parametrize("name", ["publishers.xsd", "subscribers.xsd"])
def test_the_xsd_is_valid_by_lxml_and_xmlschema(name):
    path = CONTRACT_DIR / name
    etree.XMLSchema(etree.parse(path))
    assert xmlschema.XMLSchema10(str(path)).target_namespace == NAMESPACE


def test_the_delivery_message_has_the_fields_of_the_paper_in_order():
    schema = xmlschema.XMLSchema10(str(CONTRACT_DIR / "publishers.xsd"))
    message = schema.types["deliveryRequestMessage"]
    fields = [(item.name, item.type.local_name, item.min_occurs) for item in message.content.iter_elements()]
    assert fields == [(name, "int" if name == "message_code" else "double", 1) for name in XSD_FIELDS]
    for name in ("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"):
        (argument,) = schema.elements[name].type.content.iter_elements()
        assert (argument.name, argument.min_occurs) == ("arg0", 0)


def test_the_path_of_the_openapi_description():
    paths = Contract.load().openapi["paths"]
    path = next(path for path in paths if "/depot_x/" in path)
    assert tuple(re.findall(r"/(\w+)/\{", path))[1:] == delivery.PATH_NAMES
    code = next(item for item in paths[path]["put"]["parameters"] if item["name"] in {"code", "message_code"})
    assert code["schema"]["enum"] == [delivery.COURIER, delivery.COFFEE]


def test_every_form_has_the_same_fields():
    assert set(delivery.MESSAGE_FIELDS) == set(delivery.XSD_FIELDS)
    assert tuple(delivery.EXAMPLE) == delivery.COORDINATES


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
