"""The WSDLs load in zeep and are what the paper prints, their XSD is valid, and all files have the same fields."""

import re

import pytest
import xmlschema
from lxml import etree
from zeep import Client

from conformance.contract.pack import Contract
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
