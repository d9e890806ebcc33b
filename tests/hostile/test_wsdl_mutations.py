"""Each element of a WSDL, wrong in each way: the suite reads it or refuses it in words, without an exception."""

import copy

import pytest
from lxml import etree

from conformance.api.soap import comparison
from conformance.api.soap.wsdl_rules import RULES
from conformance.documents.wsdl import WsdlError, describe, read_services, unusable
from conformance.documents.wsdl_pack import write_soap_pack
from conformance.papers_robot.statement import CONTRACT_DIR

_SOURCE = "http://device/service?wsdl"
_WSDL = b"""<w:definitions xmlns:w="http://schemas.xmlsoap.org/wsdl/" xmlns:s="http://schemas.xmlsoap.org/wsdl/soap/"
    xmlns:xs="http://www.w3.org/2001/XMLSchema" xmlns:t="urn:t" targetNamespace="urn:t" name="Device">
  <w:types><xs:schema targetNamespace="urn:t" elementFormDefault="qualified">
    <xs:element name="Get"><xs:complexType><xs:sequence>
      <xs:element name="id" type="xs:int" minOccurs="0" maxOccurs="3"/>
    </xs:sequence></xs:complexType></xs:element>
    <xs:element name="Got" type="t:Kind"/>
    <xs:simpleType name="Kind">
      <xs:restriction base="xs:string"><xs:enumeration value="a"/></xs:restriction></xs:simpleType>
  </xs:schema></w:types>
  <w:message name="in"><w:part name="p" element="t:Get"/></w:message>
  <w:message name="out"><w:part name="p" element="t:Got"/></w:message>
  <w:portType name="P"><w:operation name="Get"><w:input message="t:in"/><w:output message="t:out"/></w:operation>
    <w:operation name="Call"><w:input message="t:in"/></w:operation></w:portType>
  <w:binding name="B" type="t:P"><s:binding style="document" transport="http://schemas.xmlsoap.org/soap/http"/>
    <w:operation name="Get"><s:operation soapAction="urn:get"/><w:input><s:body use="literal"/></w:input>
      <w:output><s:body use="literal"/></w:output></w:operation>
    <w:operation name="Call"><s:operation soapAction="" style="rpc"/>
      <w:input><s:body use="literal" namespace="urn:t" parts="p"/></w:input></w:operation></w:binding>
  <w:service name="S"><w:port name="Q" binding="t:B"><s:address location="http://device/service"/></w:port></w:service>
</w:definitions>"""
_TEXTS = ("", "5", "t:gone", "no:prefix", "http://[", "a b\u00e9", "{}")


def _edits():
    """Yield a name and an edit of one element for each kind of wrong."""
    yield "gone", lambda one: one.getparent() is not None and one.getparent().remove(one)
    yield "twice", lambda one: one.getparent() is not None and one.addnext(copy.deepcopy(one))
    yield "in itself", lambda one: one.append(copy.deepcopy(one))
    yield "empty", lambda one: [one.remove(child) for child in list(one)]
    yield "text", lambda one: setattr(one, "text", "words")
    yield "renamed", lambda one: setattr(one, "tag", "{urn:x}odd")
    for text in _TEXTS:
        for key in ("name", "type", "element", "message", "binding", "location", "style", "parts", "use", "namespace"):
            yield f"{key}={text!r}", lambda one, key=key, text=text: key in one.attrib and one.set(key, text)
    for key in ("ref", "type", "minOccurs", "base", "message", "location"):
        yield f"new {key}", lambda one, key=key: one.set(key, "t:gone")


_ORIGINAL = etree.fromstring(_WSDL)


def _mutated(edit):
    """Yield each document in which an edit changed one element."""
    seen = {etree.tostring(_ORIGINAL)}
    for number in range(sum(1 for _ in _ORIGINAL.iter())):
        root = copy.deepcopy(_ORIGINAL)
        edit(list(root.iter())[number])
        document = etree.tostring(root)
        if document not in seen:
            seen.add(document)
            yield document


@pytest.mark.parametrize("edit", [pytest.param(edit, id=name) for name, edit in _edits()])
def test_a_wrong_wsdl_is_read_or_refused_in_words(edit, tmp_path):
    for document in _mutated(edit):
        for read in (_as_a_device, _as_the_papers_robot):
            try:
                said = read(document, tmp_path)
            except WsdlError as error:
                said = [str(error)]
            assert not [text for text in said if "NoneType" in text or "Traceback" in text], document


def _fetch(place):
    raise OSError(f"{place} is not there")


def _as_a_device(document, folder):
    found = read_services(document, _SOURCE, _fetch)
    write_soap_pack(folder / "pack", found, _SOURCE, {_SOURCE: document})
    return [*found.faults, *found.notes]


def _as_the_papers_robot(document, _):
    contract, robot = describe(_WSDL, _SOURCE, _fetch), describe(document, _SOURCE, _fetch)
    broken = [*unusable(robot), *(found for rule in RULES.values() for found in _quiet(rule, robot))]
    compared = (comparison.names, comparison.operations, comparison.types, comparison.actions)
    return broken + [found for compare in compared for found in _quiet(compare, contract, robot)]


def _quiet(check, *descriptions):
    try:
        return list(check(*descriptions))
    except WsdlError as error:
        return [str(error)]


def test_the_unchanged_one_and_the_contract_are_read():
    assert read_services(_WSDL, _SOURCE, _fetch).faults == ()
    assert describe((CONTRACT_DIR / "publishers.wsdl").read_bytes(), _SOURCE, _fetch).operations
