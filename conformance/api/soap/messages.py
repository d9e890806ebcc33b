"""Make messages from a schema: one ordinary message, and strategies for all valid ones."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from conformance.api.soap import forms
from conformance.documents import xsd_shapes as lexical
from conformance.documents.xml import XSI, Node, clark, local
from conformance.documents.xsd_shapes import Complex, Element, Group, Simple, as_typed

# Most elements of one kind in a message: a schema that demands more is not supported.
_MOST: Final = 1000


def padded(document: bytes, octets: int) -> bytes:
    """Return a document of the given length in bytes, filled with blanks before its last end tag."""
    end = document.rindex(b"</")
    return document[:end] + b" " * (octets - len(document)) + document[end:]


def ordinary(element: Element, *, optional: bool = False, form: int = 0) -> Node:
    """One valid message with ordinary values, with optional elements and attributes or without.

    An optional element that alone is in its parent is always made: a wrapper without its argument says nothing.
    ``form`` tells which branch a choice has, in rotation; in an odd one, what may repeat is there twice if optional.
    """
    kind = element.type
    if isinstance(kind, Simple):
        return Node(element.tag, lexical.plain(kind))
    attributes = tuple((name, lexical.plain(simple)) for name, simple, needed in kind.attributes if needed or optional)
    if kind.text is not None:
        return Node(element.tag, lexical.plain(kind.text), (), attributes)
    return Node(element.tag, "", _ordinary(kind.content, form, optional=optional), attributes)


def _ordinary(group: Group | None, form: int, *, optional: bool) -> tuple[Node, ...]:
    if group is None:
        return ()
    if group.model == "choice":
        return _some(group.items[form % len(group.items)], form, optional=optional) if group.items else ()
    alone = len(group.items) == 1
    return tuple(node for item in group.items for node in _some(item, form, optional=optional, alone=alone))


def _some(item: Element | Group, form: int, *, optional: bool, alone: bool = False) -> tuple[Node, ...]:
    most = 1 + form % 2
    count = max(item.minimum, min(most, most if item.maximum is None else item.maximum) if optional or alone else 0)
    if isinstance(item, Element):
        return (ordinary(item, optional=optional, form=form),) * min(count, _MOST)
    return _ordinary(item, form, optional=optional) * min(count, _MOST)


def message_of(element: Element, values: Mapping[str, str | list[str]]) -> Node:
    """Return a message of given values (by the local name of the element), in the order of the schema.

    Elements without a value are left out, and so are those that would be empty.
    """
    given = values.get(local(element.tag), "")
    children = list[Node]()
    for child in element.children:
        many = values.get(local(child.tag))
        children += [Node(child.tag, text) for text in many] if isinstance(many, list) else [message_of(child, values)]
    kept = [child for child in children if child.children or child.name in values]
    return Node(element.tag, given if isinstance(given, str) else "", tuple(kept))


def variants(element: Element, base: Node, fixed: frozenset[tuple[int, ...]] = frozenset()) -> SearchStrategy[Node]:
    """Return a strategy for valid messages of the same structure as ``base``, with other values.

    Those at ``fixed`` paths are left as they are, because the contract limits them beyond the schema.
    """
    leaves = [(path, simple) for path, simple in simple_leaves(element, base) if path not in fixed]
    if not leaves:
        return st.just(base)

    def with_texts(texts: tuple[str, ...]) -> Node:
        made = base
        for (path, _), text in zip(leaves, texts, strict=True):
            made = with_text(made, path, text)
        return made

    return st.tuples(*(forms.values(simple) for _, simple in leaves)).map(with_texts)


def with_text(node: Node, path: tuple[int, ...], text: str) -> Node:
    """Return a copy of a message with another text at a path."""
    return node.replaced(path, replace(node.at(path), text=text))


def derivations(element: Element, node: Node) -> Iterator[Node]:
    """Yield the message with a derived type in place of one that it has, in turn; the values in common stay."""
    for path, declared in declarations(element, node):
        for name, kind in () if isinstance(declared.type, Simple) else declared.type.derived:
            full, own = ordinary(replace(declared, type=kind), optional=True), node.at(path)
            more = tuple(child for child in full.children if child.tag not in {one.tag for one in own.children})
            attributes = (*own.attributes, (clark(XSI, "type"), name))
            yield node.replaced(path, replace(own, children=(*own.children, *more), attributes=attributes))


def declarations(element: Element, node: Node) -> list[tuple[tuple[int, ...], Element]]:
    """Return path and declaration of each descendant of a valid message, if it has one."""
    found: list[tuple[tuple[int, ...], Element]] = []
    by_tag = {child.tag: child for child in element.children}
    for index, child in enumerate(node.children):
        declared = by_tag.get(child.tag)
        if declared is not None:
            declared = as_typed(declared, child)
            found.append(((index,), declared))
            found += [((index, *path), inner) for path, inner in declarations(declared, child)]
    return found


def simple_leaves(element: Element, node: Node) -> list[tuple[tuple[int, ...], Simple]]:
    """Return the paths of the values in a valid message, attributes included, each with its type."""
    found: list[tuple[tuple[int, ...], Simple]] = []
    for path, declared in [((), element), *declarations(element, node)]:
        kind = declared.type
        simple = kind if isinstance(kind, Simple) else kind.text
        found += [(path, simple)] if simple is not None else []
        types = {} if isinstance(kind, Simple) else {name: one for name, one, _ in kind.attributes}
        names = [name for name, _ in node.at(path).attributes]
        found += [((*path, ~index), types[name]) for index, name in enumerate(names) if name in types]
    return found


def sequences(element: Element, node: Node) -> list[tuple[int, ...]]:
    """Return the paths of the elements whose children have a fixed order."""
    found: list[tuple[int, ...]] = [()] if _is_sequence(element) else []
    return found + [path for path, declared in declarations(element, node) if _is_sequence(declared)]


def _is_sequence(element: Element) -> bool:
    return (
        isinstance(element.type, Complex)
        and element.type.content is not None
        and element.type.content.model == "sequence"
        and element.type.text is None
    )


def unknown_in(element: Element, node: Node) -> str:
    """Return the tag of an element whose type no document declares; empty if there is none."""
    found = [(element.tag, element)] + [(declared.tag, declared) for _, declared in declarations(element, node)]
    return next((tag for tag, one in found if isinstance(one.type, Complex) and one.type.unknown), "")
