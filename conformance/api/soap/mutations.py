"""Mutations of a valid SOAP message: each breaks a schema in one named way.

A mutation is a candidate only. Whether the message really is invalid is for both validators to say (see invalid_ones).
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Final

from conformance.api.mutations import Member, Mutation, broken_members
from conformance.api.soap.messages import declarations, ordinary, sequences, simple_leaves, with_text
from conformance.documents import xsd_shapes as lexical
from conformance.documents.xml import XSI, Node, clark, local, namespace, parse
from conformance.documents.xsd import Types
from conformance.documents.xsd_shapes import Element, Group, Simple

STRANGE: Final = "urn:example:strange"
_NOBODY: Final = "no_such_element"
#: The children of a Body element.
Payload = tuple[Node, ...]
# Kinds of faults that no schema can forbid.
_BEYOND_SCHEMA: Final = frozenset({"body", "non-finite"})
# An element with a `maxOccurs` from this on is not sent once too often.
_MANY: Final = 100


def invalid_ones(mutations: Iterable[Mutation[Payload]], types: Types) -> Iterator[Mutation[Payload]]:
    """Yield mutants that both validators refuse, with the reason, and those that break a rule beyond the schema."""
    for mutation in mutations:
        if mutation.kind in _BEYOND_SCHEMA:
            yield mutation
            continue
        reason = types.invalid(parse(mutation.made[0].serialize()))
        if reason:
            yield replace(mutation, reason=reason)


def mutations(element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    """Yield all single mutations of ``base``, a valid child of the Body."""
    for make in (_members, _order, _namespace, _values, _nil, _body):
        yield from make(element, base)


def _members(element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    ordered = set(sequences(element, base))
    for path, declared in [((), element), *declarations(element, base)]:
        parent = base.at(path)
        by_tag = {child.tag: child for child in declared.children}
        members = [_member(child, by_tag.get(child.tag)) for child in parent.children]
        strange = [Node(clark(space, _NOBODY), "1") for space in ("", namespace(base.tag), STRANGE)]

        def write(items: list[Node], path: tuple[int, ...] = path, parent: Node = parent) -> Payload:
            return (base.replaced(path, replace(parent, children=tuple(items))),)

        unknown = [Member(node.tag, node) for node in strange] if path in ordered else []
        yield from broken_members(parent.name, members, unknown, write)


def _member(child: Node, declared: Element | None) -> Member:
    if declared is None:
        return Member(child.name, child, repeatable=True)
    return Member(child.name, child, declared.minimum > 0, declared.maximum is None)


def _order(element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    for path in sequences(element, base):
        parent = base.at(path)
        children = parent.children
        orders = [("reversed children", children[::-1])]
        for index, (one, other) in enumerate(pairwise(children)):
            orders.append((f"{one.name} after {other.name}", (*children[:index], other, one, *children[index + 2 :])))
        for what, order in orders:
            if [child.tag for child in order] == [child.tag for child in children]:
                continue
            made = base.replaced(path, replace(parent, children=tuple(order)))
            yield Mutation("order", f"{what} at {parent.name}", (made,))


def _namespace(element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    own = namespace(base.tag)
    for space in ("", STRANGE):
        made = replace(base, tag=clark(space, base.name))
        yield Mutation("namespace", f"{base.name} in {space or 'no'} namespace", (made,))
    for path, declared in declarations(element, base):
        for space in ("", own, STRANGE):
            tag = clark(space, local(declared.tag))
            if tag != declared.tag:
                made = base.replaced(path, replace(base.at(path), tag=tag))
                yield Mutation("namespace", f"{local(declared.tag)} in {space or 'no'} namespace", (made,))


def _values(element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    for path, simple in simple_leaves(element, base):
        texts = [("lexical", text) for text in lexical.unreadable(simple)]
        texts += [("range", text) for text in (*lexical.outside(simple), *_overflows(simple, base.at(path).text))]
        texts += [("non-finite", text) for text in lexical.NON_FINITE if simple.builtin in lexical.FLOATS]
        for kind, text in texts:
            yield Mutation(kind, f"{text!r} at {base.at(path).name}", (with_text(base, path, text),))


def facets(element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    """Yield mutations that facets, choices, numbers of elements and required attributes may forbid."""
    for path, simple in simple_leaves(element, base):
        node = base.at(path)
        for text in lexical.beyond(simple, node.text):
            yield Mutation("facet", f"{text[:60]!r} at {node.name}", (with_text(base, path, text),))
        if path and path[-1] < 0:
            yield Mutation("missing", f"{node.name} missing at {base.at(path[:-1]).name}", (base.replaced(path),))
    for path, declared in [((), element), *declarations(element, base)]:
        parent = base.at(path)
        by_tag = {child.tag: child for child in declared.children}
        for number, child in enumerate(parent.children):
            most = by_tag[child.tag].maximum if child.tag in by_tag else None
            if most and 1 < most < _MANY:
                more = base.replaced((*path, number), *(child,) * (most + 1))
                yield Mutation("facet", f"{most + 1} times {child.name} at {parent.name}", (more,))
    for path, says, other in branches(element, base):
        yield Mutation("facet", f"{says}, and both", (base.replaced(path, base.at(path), ordinary(other)),))


def branches(element: Element, base: Node) -> Iterator[tuple[tuple[int, ...], str, Element]]:
    """Yield alternatives for an element that a choice allows: its path, a description, and the other element."""
    for path, declared in [((), element), *declarations(element, base)]:
        content = None if isinstance(declared.type, Simple) else declared.type.content
        for number, child in enumerate(base.at(path).children):
            for other in _branches(content, child.tag):
                yield (*path, number), f"{local(other.tag)} in place of {child.name}", other


def _branches(group: Group | None, tag: str) -> Iterator[Element]:
    """Yield the elements that a choice allows in place of one."""
    for item in group.items if group else ():
        if isinstance(item, Group):
            yield from _branches(item, tag)
        elif group and group.model == "choice" and tag in {element.tag for element in group.elements()} - {item.tag}:
            yield item


def _overflows(simple: Simple, text: str) -> tuple[str, ...]:
    """Return texts that equal a value in a program that keeps only the lower 32 bits of an integer."""
    number = lexical.number_in(text) if simple.builtin in lexical.INTEGERS else None
    return (str(int(number) + 2**32),) if number is not None else ()


def _nil(element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    nil = (clark(XSI, "nil"), "true")
    for path, declared in declarations(element, base):
        if not declared.nillable:
            empty = Node(declared.tag, "", (), (nil,))
            yield Mutation("nil", f"xsi:nil at {local(declared.tag)}", (base.replaced(path, empty),))


def _body(_element: Element, base: Node) -> Iterator[Mutation[Payload]]:
    yield Mutation("body", "an empty Body", ())
    yield Mutation("body", f"{base.name} twice in the Body", (base, base))
    yield Mutation("body", "a strange element behind it in the Body", (base, Node(clark(STRANGE, _NOBODY))))
    yield Mutation("body", "a strange element before it in the Body", (Node(clark(STRANGE, _NOBODY)), base))
