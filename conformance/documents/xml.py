"""The suite's XML parser, and functions that read an element's text and children.

Documents from a robot are hostile input: entities are not expanded, DTDs not loaded, nothing is fetched, and libxml2's
limits on depth, names and texts stay on (no ``huge_tree``). The transport limits the size. A DOCTYPE is rejected
unless the caller asks for it.
"""

from lxml import etree


class NotXmlError(ValueError):
    """Raised for bytes that are not an acceptable XML document; the message says why."""


def parse(document: bytes, *, doctype: bool = False, comments: bool = True) -> etree._Element:
    """Return the root element of an untrusted document.

    Args:
        document: bytes.
        doctype: whether a DOCTYPE is accepted (and ignored) instead of rejected.
        comments: whether comments and processing instructions are kept; without them, text is not split.

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
        raise NotXmlError(f"not well-formed XML: {_short(error)}") from error
    if not doctype and has_doctype(root):
        raise NotXmlError("XML with a document type declaration (DOCTYPE)")
    return root


def _short(error: Exception) -> str:
    """Return lxml's message without the placeholder for a file name."""
    return ascii(str(error).replace(" (<string>, line", " (line"))[1:-1][:300]


def has_doctype(root: etree._Element) -> bool:
    """Return whether the document of a root element has a DOCTYPE."""
    return root.getroottree().docinfo.internalDTD is not None


def elements(parent: etree._Element) -> list[etree._Element]:
    """Return the element children, without comments, processing instructions and entities."""
    return [child for child in parent if isinstance(child.tag, str)]


def text_of(element: etree._Element) -> str:
    """Return the text directly inside an element, across comments and CDATA sections."""
    parts = [element.text or ""]
    parts += [child.tail or "" for child in element]
    return "".join(parts)
