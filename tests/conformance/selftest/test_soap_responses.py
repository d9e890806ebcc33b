"""Edits of SOAP responses do what they say, and nothing to what they do not concern."""

import pytest
from lxml import etree

from proof.mutation.changes import SOAP, becomes, page
from proof.mutation.messages import Request
from proof.mutation.xml_trees import each, find_named, says, tree
from proof.table1.mutants import soap_responses as edits

ASKED = Request("soap", "POST", "/")


def refused():
    return edits.fault("Client", "no")(ASKED)


def test_a_fault_is_told_from_an_answer():
    assert edits.is_fault(refused())
    assert not edits.is_fault(edits.envelop("<x/>")(ASKED))


@pytest.mark.parametrize(
    ("edit", "shown"),
    [
        (edits.set_code("Server"), b"s:Server<"),
        (edits.unbound, b"nowhere:Client<"),
        (edits.add_doctype, b"<!DOCTYPE s:Envelope>"),
        (edits.add_instruction, b"<?robot drive?>"),
        (edits.latin, b"ISO-8859-1"),
        (edits.fault_tree(each("faultstring", says(edits.TRACE))), b"NullPointerException"),
        (edits.fault_tree(edits.add_hint), b"<hint>"),
        (page(500, b"<html>", "text/html"), b"<html>"),
    ],
)
def test_an_edit_shows(edit, shown):
    response = refused()
    assert shown not in response.body
    edit(response)
    assert shown in response.body


def test_a_header_block_comes_before_the_body():
    response = refused()
    tree(edits.understood_true)(response)
    root = etree.fromstring(response.body)
    assert [etree.QName(child).localname for child in root] == ["Header", "Body"]
    assert find_named(root, "battery")[0].get(f"{{{SOAP}}}mustUnderstand") == "true"


def test_a_status_is_changed_with_its_reason():
    response = refused()
    becomes(202)(response)
    assert response.octets().startswith(b"HTTP/1.1 202 Accepted\r\n")
