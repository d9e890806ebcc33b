"""Descriptions of any layout come to the same."""

import re

import pytest

from conformance.api.soap import comparison
from conformance.api.soap.wsdl_rules import RULES
from conformance.documents.wsdl import WsdlError, describe, read_file, unusable
from conformance.documents.xml import clark
from conformance.papers_robot.statement import CONTRACT_DIR

CONTRACT = read_file(CONTRACT_DIR / "publishers.wsdl")
WSDL = (CONTRACT_DIR / "publishers.wsdl").read_bytes()
XSD = (CONTRACT_DIR / "publishers.xsd").read_bytes()
BASE = "http://robot:5555/ws?wsdl"
SPACE = "http://soap.turtlebot.mybot.org/"
COMPARISONS = (comparison.names, comparison.operations, comparison.types, comparison.actions)


def layout(wsdl: bytes, documents: dict[str, bytes]):
    asked = []

    def fetch(location: str) -> bytes:
        asked.append(location)
        if location not in documents:
            raise OSError("not there")
        return documents[location]

    return describe(wsdl, BASE, fetch), asked


def compared(robot) -> list[str]:
    return [problem for compare in COMPARISONS for problem in compare(CONTRACT, robot)]


AS_JAX_WS_RI = WSDL.replace(b'schemaLocation="publishers.xsd"', b'schemaLocation="http://robot:5555/ws?xsd=1"')


@pytest.mark.parametrize(
    ("wsdl", "schema"),
    [(AS_JAX_WS_RI, "http://robot:5555/ws?xsd=1"), (WSDL, "http://robot:5555/publishers.xsd")],
    ids=["JAX-WS RI", "relative"],
)
def test_as_jax_ws_ri_imports_it_and_relative_to_the_wsdl(wsdl, schema):
    robot, asked = layout(wsdl, {schema: XSD})
    assert (asked, compared(robot), list(unusable(robot))) == ([schema], [], [])


def test_inline():
    inline = re.sub(rb"<\?xml.*?\?>", b"", XSD)
    wsdl = re.sub(rb"(?s)<xs:schema>.*?</xs:schema>", lambda _: inline, WSDL)
    robot, asked = layout(wsdl, {})
    assert (asked, compared(robot)) == ([], [])


def test_split_by_include_and_wsdl_import():
    types = re.search(rb"(?s)<xs:complexType name=\"deliveryRequestMessage\">.*?</xs:complexType>", XSD)[0]
    head = re.search(rb"(?s)<xs:schema .*?>", XSD)[0]
    split = XSD.replace(types, b"").replace(head, head + b'<xs:include schemaLocation="types.xsd"/>')
    top = re.sub(rb"(?s)<wsdl:types>.*</wsdl:portType>", b"", WSDL).replace(
        b"<wsdl:binding",
        b'<wsdl:import namespace="http://soap.turtlebot.mybot.org/" location="ws?wsdl=1"/><wsdl:binding',
        1,
    )
    parts = re.sub(rb"(?s)<wsdl:binding.*</wsdl:service>", b"", WSDL)
    robot, asked = layout(
        top,
        {
            "http://robot:5555/ws?wsdl=1": parts,
            "http://robot:5555/publishers.xsd": split,
            "http://robot:5555/types.xsd": head + types + b"</xs:schema>",
        },
    )
    assert len(asked) == 3
    assert compared(robot) == []
    assert [problem for rule in RULES.values() for problem in rule(robot)] == []


def test_what_is_missing_is_told():
    robot, _ = layout(WSDL, {})
    assert robot.documents.missing == {"http://robot:5555/publishers.xsd": "not there"}
    assert compared(robot)


def test_endless_references_end():
    def fetch(location: str) -> bytes:
        number = int(location.rpartition("=")[2] or 0) if "=" in location else 0
        include = f'<xs:include schemaLocation="a?n={number + 1}"/>'
        return f'<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">{include}</xs:schema>'.encode()

    assert "more than" in next(iter(describe(WSDL, BASE, fetch).documents.missing.values()))


@pytest.mark.parametrize("document", [b"", b"<a/>", b"<html>", b"\x00"])
def test_what_is_no_wsdl(document):
    with pytest.raises(WsdlError):
        describe(document, BASE, lambda _: b"")


def test_prefixes_and_type_names_are_free():
    wsdl = WSDL.replace(b"wsdl:", b"").replace(b"xmlns:wsdl", b"xmlns")
    xsd = XSD.replace(b"deliveryRequestMessage", b"anyOtherName").replace(b"tns:", b"q:").replace(b":tns", b":q")
    robot, _ = layout(wsdl, {"http://robot:5555/publishers.xsd": xsd})
    assert compared(robot) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (b'name="depot_x" type="xs:double"', b'name="depot_x" type="xs:float"', "depot_x of type float, not double"),
        (b'name="source_y"', b'name="sourceY"', "sourceY"),
        (b'type="xs:int"/>', b'type="xs:int" minOccurs="0"/>', "that occurs 0 to 1 times, not 1 to 1 times"),
        (b'version="1.0">', b'version="1.0" elementFormDefault="qualified">', "{http://soap.turtlebot.mybot.org/}arg0"),
    ],
)
def test_differences_of_types_are_named(old, new, told):
    robot, _ = layout(WSDL, {"http://robot:5555/publishers.xsd": XSD.replace(old, new)})
    assert any(told in problem for problem in comparison.types(CONTRACT, robot))


def test_the_action_of_jax_ws_ri_is_one_that_the_contract_allows():
    wsdl = re.sub(rb'(<wsdl:input [^>]*Action="[^"]*)"', rb'\1Request"', WSDL)
    robot, _ = layout(wsdl, {"http://robot:5555/publishers.xsd": XSD})
    assert list(comparison.actions(CONTRACT, robot)) == []


def test_the_contract_keeps_its_own_rules():
    for name in ("publishers", "subscribers"):
        contract = read_file(CONTRACT_DIR / f"{name}.wsdl")
        assert {rule: list(check(contract)) for rule, check in RULES.items() if list(check(contract))} == {}
        assert contract.shape(clark(SPACE, "NoSuchElement")) is None


def problems(old: str, new: str) -> dict[str, list[str]]:
    """What is wrong with the contract's WSDL where a regular expression of it and of its schema is replaced."""
    spoiled = [re.sub(old.encode(), new.encode(), document) for document in (WSDL, XSD)]
    assert spoiled != [WSDL, XSD]
    robot, _ = layout(spoiled[0], {"http://robot:5555/publishers.xsd": spoiled[1]})
    found = {compare.__name__: list(compare(CONTRACT, robot)) for compare in COMPARISONS}
    return found | {rule: list(check(robot)) for rule, check in RULES.items()}


BREACHES = {
    "names": {'(<wsdl:service name=")': r"\1X", "http://soap.turtlebot.mybot.org/": "http://soap.example.org/"},
    "operations": {"ExecuteCoffeeRequest": "Other", 'soapAction=""': 'soapAction="urn:x"'},
    "types": {":double": ":int", '(name="depot_x")': r'\1 minOccurs="0"'},
    "actions": {'Action="[^"]*"': 'Action="urn:x"'},
    "R2701": {' transport="[^"]*"': ""},
    "R2702": {'transport="[^"]*"': 'transport="urn:smtp"'},
    "R2705": {'style="document"': 'style="rpc"'},
    "R2706": {'use="literal"': 'use="encoded"'},
    "R2716": {'use="literal"': 'use="literal" namespace="urn:x"'},
    "R2204": {'(<wsdl:part [^>]*)element="': r'\1type="'},
    "R2206": {r'(<wsdl:part [^>]*element="\w+:)': r"\1No"},
    "R2304": {r"(?s)(<wsdl:operation .*?</wsdl:operation>)(?=.*portType>)": r"\1\1"},
    "R4003": {r"encoding=.[\w-]+.": "encoding='iso-8859-1'"},
}


@pytest.mark.parametrize(
    ("rule", "old", "new"), [(rule, *change) for rule, changes in BREACHES.items() for change in changes.items()]
)
def test_a_wrong_description_breaks_its_rule(rule, old, new):
    assert problems(old, new)[rule]
