"""Edits of XML documents, for mutants: find elements by name, change or remove them."""

from collections.abc import Callable
from typing import Any

from lxml import etree

from proof.mutation.messages import Response


def tree(edit: Callable[[Any], object]) -> Callable[[Response], object]:
    """Return an edit that applies ``edit`` to the root of an XML response; other responses stay unchanged."""

    def apply(response: Response) -> None:
        root = xml(response.body)
        if root is not None:
            edit(root)
            response.body = etree.tostring(root, xml_declaration=True, encoding="UTF-8")

    return apply


def xml(body: bytes) -> Any:
    """Return the root of an XML document without comments and CDATA, or None if it is not XML."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=True)
    try:
        return etree.fromstring(body, parser)
    except (etree.XMLSyntaxError, ValueError):
        return None


def find_named(root: Any, name: str) -> list[Any]:
    """Return the elements with a local name, in document order."""
    return [node for node in root.iter() if isinstance(node.tag, str) and etree.QName(node).localname == name]


def each(name: str, edit: Callable[[Any], object], which: slice = slice(None)) -> Callable[[Any], None]:
    """Return an edit that applies ``edit`` to the elements with a local name, or to the slice ``which`` of them."""

    def apply(root: Any) -> None:
        for node in find_named(root, name)[which]:
            edit(node)

    return apply


def remove(node: Any) -> None:
    """Remove an element from its tree."""
    node.getparent().remove(node)


def says(value: str) -> Callable[[Any], None]:
    """Return an edit that sets an element's text."""
    return lambda node: setattr(node, "text", value)
