"""Messages made from a schema: valid to both validators, or invalid to both, and the same however they are written."""

from decimal import Decimal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from conformance.api.soap.envelope import envelope, read
from conformance.api.soap.forms import written_float, written_integer
from conformance.api.soap.messages import ordinary, simple_leaves, variants, with_text
from conformance.api.soap.mutations import invalid_ones, mutations
from conformance.api.soap.xml_style import XmlStyle, serialize, single_changes, value_styles, xml_styles
from conformance.documents.wsdl import read_file
from conformance.documents.xml import ENVELOPE, Node, clark, parse
from conformance.documents.xsd import Types
from conformance.documents.xsd_assembly import SchemaDocument
from conformance.documents.xsd_shapes import Simple, is_alike, plain, unreadable
from conformance.papers_robot.statement import CONTRACT_DIR

XSD = b"""<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" xmlns:t="urn:t" targetNamespace="urn:t"
                     elementFormDefault="qualified">
  <xs:element name="Order"><xs:complexType><xs:sequence>
    <xs:element name="size"><xs:simpleType><xs:restriction base="xs:string">
      <xs:enumeration value="small"/><xs:enumeration value="large"/></xs:restriction></xs:simpleType></xs:element>
    <xs:element name="hot" type="xs:boolean"/>
    <xs:element name="cups"><xs:simpleType><xs:restriction base="xs:short">
      <xs:minExclusive value="0"/><xs:maxExclusive value="13"/></xs:restriction></xs:simpleType></xs:element>
    <xs:element name="price" minOccurs="0"><xs:simpleType><xs:restriction base="xs:decimal">
      <xs:minExclusive value="0"/><xs:maxExclusive value="9.5"/></xs:restriction></xs:simpleType></xs:element>
    <xs:element name="weight" type="xs:float" nillable="true"/>
    <xs:element name="note" minOccurs="0"><xs:simpleType><xs:restriction base="xs:string">
      <xs:maxLength value="8"/></xs:restriction></xs:simpleType></xs:element>
    <xs:element name="serial" type="xs:unsignedInt" form="unqualified"/>
    <xs:choice><xs:element name="milk" type="t:Milk"/><xs:element name="black" type="xs:string"/></xs:choice>
  </xs:sequence><xs:attribute name="id" type="xs:int" use="required"/></xs:complexType></xs:element>
  <xs:complexType name="Milk"><xs:simpleContent><xs:extension base="xs:double"/></xs:simpleContent></xs:complexType>
</xs:schema>"""
TYPES = Types([SchemaDocument("order.xsd", etree.fromstring(XSD))])
ORDER = TYPES.shape(clark("urn:t", "Order"))
DELIVERY = read_file(CONTRACT_DIR / "publishers.wsdl")
REQUEST = DELIVERY.shape(clark("http://soap.turtlebot.mybot.org/", "ExecuteDeliveryRequest"))


def test_an_ordinary_message_is_valid():
    for optional in (False, True):
        assert TYPES.valid(parse(ordinary(ORDER, optional=optional).serialize()))
    assert [child.name for child in ordinary(ORDER).children] == ["size", "hot", "cups", "weight", "serial", "milk"]


@settings(max_examples=300, database=None, deadline=None)
@given(variants(ORDER, ordinary(ORDER, optional=True)))
def test_all_variants_are_valid(message):
    element = parse(message.serialize())
    assert (TYPES.libxml_problem(element), TYPES.python_problem(element)) == ("", "")


@settings(max_examples=300, database=None, deadline=None)
@given(variants(REQUEST, ordinary(REQUEST)))
def test_variants_of_the_contract_are_valid_and_finite(message):
    assert DELIVERY.types.valid(parse(message.serialize()))
    assert all(abs(float(leaf.text)) < float("inf") for leaf in message.children[0].children)


def test_mutations_are_of_every_kind_and_invalid_to_both():
    found = list(invalid_ones(mutations(ORDER, ordinary(ORDER, optional=True)), TYPES))
    kinds = {"missing", "unknown", "duplicate", "order", "namespace", "lexical", "range", "nil", "non-finite", "body"}
    assert {mutant.kind for mutant in found} == kinds
    for mutant in found:
        if mutant.kind not in {"body", "non-finite"}:
            element = parse(mutant.made[0].serialize())
            assert TYPES.libxml_problem(element), mutant.what
            assert TYPES.python_problem(element), mutant.what
    # A nillable element that is nil is no mutation, nor is an optional one that is left out.
    whats = [mutant.what for mutant in found]
    assert "xsi:nil at hot" in whats
    assert "hot missing at Order" in whats
    assert not any("xsi:nil at weight" in what or "note missing" in what for what in whats)


def test_a_text_that_one_validator_takes_is_no_mutation():
    leaf = next(path for path, simple in simple_leaves(REQUEST, ordinary(REQUEST)) if simple.builtin == "double")
    element = parse(with_text(ordinary(REQUEST), leaf, "1e").serialize())
    # libxml2 reads an empty exponent, against XML Schema 1.0 Part 2, 3.2.5.1.
    assert DELIVERY.types.python_problem(element)
    assert not DELIVERY.types.invalid(element)


@settings(database=None, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(0, 7))
def test_every_form_of_a_float_is_exactly_it(value, form):
    assert float(written_float(value, form)) == value
    assert Decimal(written_float(value, form)) == Decimal(repr(value))


@settings(database=None, deadline=None)
@given(st.integers(-(2**31), 2**31), st.integers(0, 7))
def test_every_form_of_an_integer_is_exactly_it(value, form):
    assert int(written_integer(value, form)) == value


@pytest.mark.parametrize(
    ("builtin", "text", "same", "other"),
    [
        ("duration", "PT90S", "PT1M30S", "PT90M"),
        ("duration", "P1Y", "P12M", "P365D"),
        ("time", "12:00:00Z", "12:00:00.0+00:00", "12:00:00"),
    ],
)
def test_forms_of_one_value(builtin, text, same, other):
    assert is_alike(Simple(builtin), text, same)
    assert not is_alike(Simple(builtin), text, other)


def canonical(document: str) -> bytes:
    root = parse(document.encode())
    body = read(document.encode()).body
    for element in root.iter():
        element.attrib.clear()
    texts = [
        (str(element.tag), "".join(element.itertext()).strip())
        for element in body.iter()
        if isinstance(element.tag, str)
    ]
    return repr(texts).replace("\\n", "").replace("  ", "").encode()


def says_the_same(style: XmlStyle) -> bool:
    message = envelope([ordinary(REQUEST)])
    written = serialize(message, style)
    same = canonical(written) == canonical(serialize(message, XmlStyle()))
    return same and DELIVERY.types.valid(read(written.encode()).first)


@pytest.mark.parametrize("style", [style for _, style in single_changes()], ids=[name for name, _ in single_changes()])
def test_single_changes_of_style_say_the_same(style):
    assert says_the_same(style)


@settings(max_examples=200, database=None, deadline=None)
@given(xml_styles())
def test_any_style_says_the_same(style):
    assert says_the_same(style)


def test_every_simple_type_has_an_ordinary_value():
    for path, simple in simple_leaves(ORDER, ordinary(ORDER, optional=True)):
        assert plain(simple) not in unreadable(simple), path


_MESSAGE = envelope([Node(clark("urn:a", "order"), children=(Node("x", "12.5"), Node("name", "a < b & c")))])


@pytest.mark.parametrize(("what", "style"), single_changes())
def test_values_are_the_same_in_every_style(what, style):
    root = parse(serialize(_MESSAGE, style).encode())
    assert root.tag == clark(ENVELOPE, "Envelope"), what
    for name, text in (("x", "12.5"), ("name", "a < b & c")):
        assert "".join(next(root.iter(name)).itertext()).strip() == text


def test_an_attribute_of_another_namespace_is_qualified():
    style = next(style for what, style in single_changes() if "attribute" in what)
    (name,) = parse(serialize(_MESSAGE, style).encode()).attrib
    assert name.startswith("{")
    assert name.endswith("}Id")


def test_styles_by_which_values_are_mistaken_come_first():
    plain = [style.text == "plain" for style in value_styles()]
    assert plain == sorted(plain)
    assert len(plain) == len(single_changes())
