"""However a message is written, it says the same."""

import pytest

from conformance.api.soap.envelope import envelope
from conformance.api.soap.xml_style import serialize, single_changes, value_styles
from conformance.documents.xml import parse
from conformance.documents.xml_names import ENVELOPE, clark
from conformance.documents.xml_node import Node

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
