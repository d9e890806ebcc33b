"""Writing of dicts, lists and numbers as JSON, XML and text.

All three formats write a double with the fewest digits that read back as the same double, so that the values are
identical in all formats (contract, class ``equivalence``).
"""

import json
import re
from typing import Any, Final

import yaml
from lxml import etree

JSON: Final = "application/json"
XML: Final = "application/xml"
TEXT: Final = "text/plain"

# XML 1.0 2.2 "Char": other characters are invalid in a document, even as character references.
_NO_XML_CHARACTER: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_REPLACEMENT: Final = "\N{REPLACEMENT CHARACTER}"

# Names of the item elements of lists at the root, which have no field name.
_ITEM_NAMES: Final = {"Sensors": "sensor", "NavigationServices": "service", "Deliveries": "delivery"}


def write_json(plain: Any) -> bytes:
    """Return a value as JSON in UTF-8 without BOM (RFC 8259 8.1); raise ValueError for a non-finite number."""
    return json.dumps(plain, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()


def write_xml(plain: Any, root: str) -> bytes:
    """Return a dict or list as XML: a child element per field; array items are repeated elements of one name."""
    return etree.tostring(element_of(plain, root), encoding="utf-8", xml_declaration=True)


def write_text(plain: Any) -> bytes:
    """Return a dict or list as a YAML document, in the form that ``ros2 topic echo`` prints."""
    text = yaml.dump(plain, Dumper=_Dumper, sort_keys=False, default_flow_style=False, allow_unicode=True, width=2**31)
    return str(text).encode()


def element_of(plain: Any, name: str) -> etree._Element:
    """Return a dict, list or value as an XML element with the given (possibly namespace-qualified) name."""
    element = etree.Element(name)
    if isinstance(plain, list):
        _fill(element, {_ITEM_NAMES.get(name, "item"): plain})
    else:
        _fill(element, plain)
    return element


def _fill(element: etree._Element, plain: Any) -> None:
    if isinstance(plain, dict):
        for name, value in plain.items():
            for item in value if isinstance(value, list) else [value]:
                _fill(etree.SubElement(element, name), item)
    else:
        element.text = text_of(plain)


def text_of(plain: Any) -> str:
    """Return a single value as text in its XML Schema lexical form."""
    if isinstance(plain, bool):
        return "true" if plain else "false"
    return _NO_XML_CHARACTER.sub(_REPLACEMENT, str(plain))


class _Dumper(yaml.SafeDumper):
    """A YAML dumper that writes equal lists in full, where PyYAML would write an alias."""

    def ignore_aliases(self, _data: Any) -> bool:
        return True


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    """Return a YAML scalar for a text, in double quotes if it contains unprintable characters.

    In single quotes PyYAML would write NEL and similar characters unescaped, and read them back as a space.
    """
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=None if text.isprintable() else '"')


_Dumper.add_representer(str, _represent_text)
