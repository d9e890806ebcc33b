"""XML elements as immutable values, for Hypothesis strategies, mutations and findings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final
from xml.sax.saxutils import escape, quoteattr

from conformance.documents.xml_names import ADDRESSING, ENVELOPE, XSI, local, namespace

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
        """Return the descendant at a path of child indexes."""
        return self.children[path[0]].at(path[1:]) if path else self

    def replaced(self, path: tuple[int, ...], *new: Node) -> Node:
        """Return a copy in which the descendant at ``path`` is replaced by zero or more nodes.

        Args:
            path: child indexes; empty for the node itself, which must be replaced by exactly one.
            new: the replacement.
        """
        if not path:
            (whole,) = new
            return whole
        index, rest = path[0], path[1:]
        inside = (self.children[index].replaced(rest, *new),) if rest else new
        return replace(self, children=(*self.children[:index], *inside, *self.children[index + 1 :]))

    def paths(self) -> list[tuple[int, ...]]:
        """Return the paths of all descendants, parents before children."""
        found: list[tuple[int, ...]] = []
        for index, child in enumerate(self.children):
            found.append((index,))
            found += [(index, *path) for path in child.paths()]
        return found

    def written(self) -> bytes:
        """Return the document in UTF-8, with all namespaces declared at the root."""
        spaces = sorted(_namespaces(self))
        # The usual prefixes where there are any: findings are read by people.
        prefixes = {space: _USUAL.get(space, f"n{number}") for number, space in enumerate(spaces)}
        bindings = "".join(f" xmlns:{prefix}={quoteattr(space)}" for space, prefix in prefixes.items())
        return _text(self, prefixes, bindings).encode()


def _namespaces(node: Node) -> set[str]:
    found = {namespace(node.tag)} | {namespace(name) for name, _ in node.attributes}
    for child in node.children:
        found |= _namespaces(child)
    return found - {""}


def _text(node: Node, prefixes: dict[str, str], bindings: str = "") -> str:
    def named(tag: str) -> str:
        space = namespace(tag)
        return f"{prefixes[space]}:{local(tag)}" if space else tag

    attributes = "".join(f" {named(name)}={quoteattr(value)}" for name, value in node.attributes)
    inside = escape(node.text) + "".join(_text(child, prefixes) for child in node.children)
    tag = named(node.tag)
    return f"<{tag}{bindings}{attributes}>{inside}</{tag}>" if inside else f"<{tag}{bindings}{attributes}/>"
