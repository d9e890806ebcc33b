"""XML as a frozen value: what strategies draw, mutations change, and findings show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final
from xml.sax.saxutils import escape, quoteattr

from conformance.documents.xml_names import ADDRESSING, ENVELOPE, XSI, local, namespace

if TYPE_CHECKING:
    from collections.abc import Callable


_USUAL: Final = {ENVELOPE: "soap", XSI: "xsi", ADDRESSING: "wsa"}


@dataclass(frozen=True)
class Node:
    """An element.

    Attributes:
        tag: name in Clark notation.
        text: character data before the first child.
        children: element children, in order.
        attributes: pairs of name in Clark notation and value.
    """

    tag: str
    text: str = ""
    children: tuple[Node, ...] = ()
    attributes: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """Local name."""
        return local(self.tag)

    def path_to(self, name: str) -> tuple[int, ...]:
        """The path of the first descendant of a local name.

        Raises:
            StopIteration: there is none.
        """
        return next(path for path in self.paths() if self.at(path).name == name)

    def at(self, path: tuple[int, ...]) -> Node:
        """The descendant at a path of child positions."""
        return self.children[path[0]].at(path[1:]) if path else self

    def changed(self, path: tuple[int, ...], change: Callable[[Node], tuple[Node, ...]]) -> Node:
        """A copy in which the descendant at ``path`` (not empty) is replaced by what ``change`` makes of it."""
        index, rest = path[0], path[1:]
        child = self.children[index]
        new = (child.changed(rest, change),) if rest else change(child)
        return replace(self, children=(*self.children[:index], *new, *self.children[index + 1 :]))

    def paths(self) -> list[tuple[int, ...]]:
        """Paths of all descendants, parents before their children."""
        found: list[tuple[int, ...]] = []
        for index, child in enumerate(self.children):
            found.append((index,))
            found += [(index, *path) for path in child.paths()]
        return found

    def written(self) -> bytes:
        """The document in plain UTF-8, each namespace bound to a prefix at the root."""
        spaces = sorted(self._namespaces())
        # The usual prefixes where there are any: findings are read by people.
        prefixes = {space: _USUAL.get(space, f"n{number}") for number, space in enumerate(spaces)}
        bindings = "".join(f" xmlns:{prefix}={quoteattr(space)}" for space, prefix in prefixes.items())
        return self._text(prefixes, bindings).encode()

    def _namespaces(self) -> set[str]:
        found = {namespace(self.tag)} | {namespace(name) for name, _ in self.attributes}
        for child in self.children:
            found |= child._namespaces()  # noqa: SLF001 - of the same class
        return found - {""}

    def _text(self, prefixes: dict[str, str], bindings: str = "") -> str:
        def named(tag: str) -> str:
            space = namespace(tag)
            return f"{prefixes[space]}:{local(tag)}" if space else tag

        attributes = "".join(f" {named(name)}={quoteattr(value)}" for name, value in self.attributes)
        inside = escape(self.text) + "".join(child._text(prefixes) for child in self.children)  # noqa: SLF001
        tag = named(self.tag)
        return f"<{tag}{bindings}{attributes}>{inside}</{tag}>" if inside else f"<{tag}{bindings}{attributes}/>"
