"""XML: the suite's parser, qualified names, and elements as immutable values.

Documents from a robot are hostile input: entities are not expanded, DTDs not loaded, nothing is fetched, and libxml2's
limits on depth, names and texts stay on (no ``huge_tree``). The transport limits the size. A DOCTYPE is rejected
unless the caller asks for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final
from xml.sax.saxutils import escape, quoteattr

from lxml import etree


class NotXmlError(ValueError):
    """Raised for bytes that are no acceptable XML document; the message explains why."""


def parse(document: bytes, *, doctype: bool = False, comments: bool = True) -> etree._Element:
    """Return the root element of an untrusted document.

    Args:
        document: bytes.
        doctype: whether a DOCTYPE is accepted (and ignored) instead of rejected.
        comments: whether comments and processing instructions are kept; without them, text is not split.

    Raises:
        NotXmlError: it is not well-formed, or has a DOCTYPE.
    """
    # A parser keeps state of its last document, so each document gets a new parser.
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


def has_instruction(root: etree._Element) -> bool:
    """Return whether the document of a root element has a processing instruction."""
    if any(node is not None for node in root.iter(etree.PI)):
        return True
    around = [*root.itersiblings(preceding=True), *root.itersiblings()]
    return any(isinstance(node, etree._ProcessingInstruction) for node in around)  # noqa: SLF001 - no public name


def elements(parent: etree._Element) -> list[etree._Element]:
    """Return the element children, without comments, processing instructions and entities."""
    return [child for child in parent if isinstance(child.tag, str)]


def text_of(element: etree._Element) -> str:
    """Return the text directly inside an element, across comments and CDATA sections."""
    parts = [element.text or ""]
    parts += [child.tail or "" for child in element]
    return "".join(parts)


ENVELOPE: Final = "http://schemas.xmlsoap.org/soap/envelope/"
WSDL: Final = "http://schemas.xmlsoap.org/wsdl/"
WSDL_SOAP: Final = "http://schemas.xmlsoap.org/wsdl/soap/"
XSD: Final = "http://www.w3.org/2001/XMLSchema"
XSI: Final = "http://www.w3.org/2001/XMLSchema-instance"
WSAM: Final = "http://www.w3.org/2007/05/addressing/metadata"
# Older namespaces of the action attribute, which tools still write.
WSAW: Final = "http://www.w3.org/2006/05/addressing/wsdl"
ADDRESSING: Final = "http://www.w3.org/2005/08/addressing"
# SOAP 1.1, 4.2.2: the actor that stands for whoever receives the message first.
NEXT_ACTOR: Final = "http://schemas.xmlsoap.org/soap/actor/next"
NEXT_12: Final = "http://www.w3.org/2003/05/soap-envelope/role/next"


def local(tag: str) -> str:
    """Return the local part of a name in Clark notation."""
    return tag.rpartition("}")[2]


def namespace(tag: str) -> str:
    """Return the namespace of a name in Clark notation; empty where it has none."""
    return tag[1:].rpartition("}")[0] if tag.startswith("{") else ""


def clark(space: str | None, name: str) -> str:
    """Return a name in Clark notation."""
    return f"{{{space}}}{name}" if space else name


_TYPE: Final = clark(XSI, "type")
_USUAL: Final = {ENVELOPE: "soap", XSI: "xsi", ADDRESSING: "wsa"}


@dataclass(frozen=True)
class Node:
    """An immutable XML element.

    Attributes:
        tag: name in Clark notation.
        text: text before the first child.
        children: child elements, in order.
        attributes: (name in Clark notation, value) pairs.
    """

    tag: str
    text: str = ""
    children: tuple[Node, ...] = ()
    attributes: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """The local name."""
        return local(self.tag)

    def path_to(self, name: str) -> tuple[int, ...]:
        """Return the path (child indexes) of the first descendant with a local name.

        Raises:
            StopIteration: there is none.
        """
        return next(path for path in self.paths() if self.at(path).name == name)

    def at(self, path: tuple[int, ...]) -> Node:
        """Return the descendant at a path of child indexes; -1 is the first attribute, as a node with its text."""
        if path and path[0] < 0:
            return Node(*self.attributes[~path[0]])
        return self.children[path[0]].at(path[1:]) if path else self

    def replaced(self, path: tuple[int, ...], *new: Node) -> Node:
        """Return a copy in which the descendant at ``path`` is replaced by zero or more nodes.

        Args:
            path: as in `at`; empty for the node itself, which must be replaced by exactly one.
            new: the replacement.
        """
        if not path:
            (whole,) = new
            return whole
        index, rest = path[0], path[1:]
        if index < 0:
            given = tuple((node.tag, node.text) for node in new)
            return replace(self, attributes=(*self.attributes[:~index], *given, *self.attributes[~index + 1 :]))
        inside = (self.children[index].replaced(rest, *new),) if rest else new
        return replace(self, children=(*self.children[:index], *inside, *self.children[index + 1 :]))

    def paths(self) -> list[tuple[int, ...]]:
        """Return the paths of all descendants, parents before children."""
        found: list[tuple[int, ...]] = []
        for index, child in enumerate(self.children):
            found.append((index,))
            found += [(index, *path) for path in child.paths()]
        return found

    def serialize(self) -> bytes:
        """Return the document in UTF-8, with all namespaces declared at the root."""
        spaces = sorted(_namespaces(self))
        # Use common prefixes where they exist, because people read findings.
        prefixes = {space: _USUAL.get(space, f"n{number}") for number, space in enumerate(spaces)}
        bindings = "".join(f" xmlns:{prefix}={quoteattr(space)}" for space, prefix in prefixes.items())
        return _text(self, prefixes, bindings).encode()


def _namespaces(node: Node) -> set[str]:
    found = {namespace(node.tag)} | {namespace(name) for name, _ in node.attributes}
    found |= {namespace(value) for name, value in node.attributes if name == _TYPE}
    for child in node.children:
        found |= _namespaces(child)
    return found - {""}


def _text(node: Node, prefixes: dict[str, str], bindings: str = "") -> str:
    def with_prefix(tag: str) -> str:
        space = namespace(tag)
        return f"{prefixes[space]}:{local(tag)}" if space else tag

    values = [(with_prefix(name), with_prefix(value) if name == _TYPE else value) for name, value in node.attributes]
    attributes = "".join(f" {name}={quoteattr(value)}" for name, value in values)
    inside = escape(node.text) + "".join(_text(child, prefixes) for child in node.children)
    tag = with_prefix(node.tag)
    return f"<{tag}{bindings}{attributes}>{inside}</{tag}>" if inside else f"<{tag}{bindings}{attributes}/>"
