"""Messages that break a schema in one named way each.

A mutation is a candidate only. Whether the message really is invalid is for both validators to say (see invalid_ones).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from conformance.api.soap.messages import declarations, sequences, simple_leaves, with_text
from conformance.documents import xsd_lexical as lexical
from conformance.documents.xml import parse
from conformance.documents.xml_names import XSI, clark, local, namespace
from conformance.documents.xml_node import Node
from conformance.documents.xsd import Types
from conformance.documents.xsd_shapes import Element, Simple

STRANGE: Final = "urn:example:strange"
_NOBODY: Final = "no_such_element"


@dataclass(frozen=True)
class Mutation:
    """A message with one thing wrong.

    Attributes:
        kind: missing, unknown, duplicate, order, namespace, lexical, range, nil, non-finite or body.
        what: what was done, naming the element.
        payload: the children of the Body.
        reason: why the validators refuse it; empty where no schema can (kinds non-finite and body).
    """

    kind: str
    what: str
    payload: tuple[Node, ...]
    reason: str = ""


def invalid_ones(mutations: Iterable[Mutation], types: Types) -> Iterator[Mutation]:
    """Those that both validators refuse; and those that break a rule beyond the schema, which they cannot judge."""
    for mutation in mutations:
        if mutation.kind in {"body", "non-finite"}:
            yield mutation
            continue
        reason = types.invalid(parse(mutation.payload[0].written()))
        if reason:
            yield replace(mutation, reason=reason)


def mutations(element: Element, base: Node) -> Iterator[Mutation]:
    """All single mutations of ``base``, a valid child of the Body."""
    for make in (_missing, _unknown, _duplicate, _order, _namespace, _values, _nil, _body):
        yield from make(element, base)


def _missing(element: Element, base: Node) -> Iterator[Mutation]:
    for path, declared in declarations(element, base):
        if declared.minimum > 0:
            yield Mutation("missing", f"{local(declared.tag)} dropped", (base.replaced(path),))


def _unknown(element: Element, base: Node) -> Iterator[Mutation]:
    for path in sequences(element, base):
        parent = base.at(path)
        for where, position in (("first", 0), ("last", len(parent.children))):
            for space in ("", namespace(base.tag), STRANGE):
                extra = Node(clark(space, _NOBODY), "1")
                children = (*parent.children[:position], extra, *parent.children[position:])
                made = base.replaced(path, replace(parent, children=children))
                yield Mutation("unknown", f"{extra.tag} {where} in {parent.name}", (made,))


def _duplicate(element: Element, base: Node) -> Iterator[Mutation]:
    for path, declared in declarations(element, base):
        if declared.maximum is not None:
            made = base.replaced(path, base.at(path), base.at(path))
            yield Mutation("duplicate", f"{local(declared.tag)} twice", (made,))


def _order(element: Element, base: Node) -> Iterator[Mutation]:
    for path in sequences(element, base):
        parent = base.at(path)
        children = parent.children
        orders = [("reversed", children[::-1])]
        for index, (one, other) in enumerate(pairwise(children)):
            orders.append((f"{one.name} after {other.name}", (*children[:index], other, one, *children[index + 2 :])))
        for what, order in orders:
            if [child.tag for child in order] == [child.tag for child in children]:
                continue
            made = base.replaced(path, replace(parent, children=tuple(order)))
            yield Mutation("order", f"children of {parent.name}: {what}", (made,))


def _namespace(element: Element, base: Node) -> Iterator[Mutation]:
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


def _values(element: Element, base: Node) -> Iterator[Mutation]:
    for path, simple in simple_leaves(element, base):
        name = base.at(path).name
        for text in lexical.unreadable(simple):
            yield Mutation("lexical", f"{name} is {text!r}", (with_text(base, path, text),))
        for text in (*lexical.outside(simple), *_wrapped(simple, base.at(path).text)):
            yield Mutation("range", f"{name} is {text}", (with_text(base, path, text),))
        if simple.builtin in lexical.FLOATS:
            for text in lexical.NON_FINITE:
                yield Mutation("non-finite", f"{name} is {text}", (with_text(base, path, text),))


def _wrapped(simple: Simple, text: str) -> tuple[str, ...]:
    """What becomes the same value where only the lower 32 bits of an integer are kept."""
    return (str(int(text) + 2**32),) if simple.builtin in lexical.INTEGERS else ()


def _nil(element: Element, base: Node) -> Iterator[Mutation]:
    nil = (clark(XSI, "nil"), "true")
    for path, declared in declarations(element, base):
        if not declared.nillable:
            empty = Node(declared.tag, "", (), (nil,))
            yield Mutation("nil", f"{local(declared.tag)} is xsi:nil", (base.replaced(path, empty),))


def _body(_element: Element, base: Node) -> Iterator[Mutation]:
    yield Mutation("body", "the Body is empty", ())
    yield Mutation("body", f"{base.name} stands twice in the Body", (base, base))
    yield Mutation("body", "a strange element stands beside it in the Body", (base, Node(clark(STRANGE, _NOBODY))))
    yield Mutation("body", "a strange element stands before it in the Body", (Node(clark(STRANGE, _NOBODY)), base))
