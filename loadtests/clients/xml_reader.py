"""The XML parser of the load tests: refuses a DOCTYPE, expands no entity and fetches nothing."""

from lxml import etree
from lxml.etree import _Element


class XmlError(ValueError):
    """Content that is not XML, or XML with a document type declaration; the message says which."""


def parse_xml(content: bytes) -> _Element:
    """Return the root element.

    Raises:
        XmlError: not well-formed, or with a DOCTYPE (WS-I Basic Profile 1.1, R1008).
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        raise XmlError(f"is not XML: {error}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise XmlError("has a document type declaration (DOCTYPE), which is refused")
    return root
