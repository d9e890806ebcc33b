"""What a mutant may do to a document of XML: elements of a name are altered, or taken out of it."""

from collections.abc import Callable
from typing import Any

from lxml import etree

from conformance.mutation.messages import Response


def tree(edit: Callable[[Any], object]) -> Callable[[Response], object]:
    """Alter the XML tree of an answer's body; what is no XML stays as it is."""

    def apply(response: Response) -> None:
        root = xml(response.body)
        if root is not None:
            edit(root)
            response.body = etree.tostring(root, xml_declaration=True, encoding="UTF-8")

    return apply


def xml(body: bytes) -> Any:
    """The root of an XML document without its comments and CDATA, or None."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=True)
    try:
        return etree.fromstring(body, parser)
    except (etree.XMLSyntaxError, ValueError):
        return None


def named(root: Any, name: str) -> list[Any]:
    """Elements with a local name, in document order."""
    return [node for node in root.iter() if isinstance(node.tag, str) and etree.QName(node).localname == name]


def each(name: str, edit: Callable[[Any], object], which: slice = slice(None)) -> Callable[[Any], None]:
    """Alter the elements of an XML tree that have a local name, or some of them; ``edit`` gets one."""

    def apply(root: Any) -> None:
        for node in named(root, name)[which]:
            edit(node)

    return apply


def gone(node: Any) -> None:
    """Take an element out of its tree."""
    node.getparent().remove(node)


def says(value: str) -> Callable[[Any], None]:
    """Give an element another text."""
    return lambda node: setattr(node, "text", value)
