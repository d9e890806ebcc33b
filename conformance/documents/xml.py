"""The suite's one XML parser, and how text and children of an element are read.

What a robot sends is hostile input: no entity is expanded, no DTD loaded, nothing fetched, and libxml2's own limits on
depth, names and texts stay on (``huge_tree``); how many octets come at all is bounded by the transport. A DOCTYPE is
refused here, unless the caller judges it by itself.
"""

from lxml import etree


class NotXmlError(ValueError):
    """Octets that are no XML document to be read; the message says why."""


def parse(document: bytes, *, doctype: bool = False, comments: bool = True) -> etree._Element:
    """Return the root element of a document from outside.

    Args:
        document: octets.
        doctype: whether a DOCTYPE is let be (unread) rather than refused.
        comments: whether comments and processing instructions are kept; without them a text is in one piece.

    Raises:
        NotXmlError: it is not well-formed, or has a DOCTYPE.
    """
    # A parser holds its last document's state, so each document gets one of its own.
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=not comments,
        remove_pis=not comments,
    )
    try:
        root = etree.fromstring(document, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise NotXmlError(f"no well-formed XML: {ascii(str(error))[1:-1][:300]}") from error
    if not doctype and has_doctype(root):
        raise NotXmlError("XML with a document type declaration (DOCTYPE)")
    return root


def has_doctype(root: etree._Element) -> bool:
    """Return whether the document of a root element has a DOCTYPE."""
    return root.getroottree().docinfo.internalDTD is not None


def elements(parent: etree._Element) -> list[etree._Element]:
    """Return the element children, without comments, processing instructions and entities."""
    return [child for child in parent if isinstance(child.tag, str)]


def text_of(element: etree._Element) -> str:
    """Return the character data right inside an element, across comments and CDATA sections."""
    parts = [element.text or ""]
    parts += [child.tail or "" for child in element]
    return "".join(parts)
