"""XML as values: mappings of local names, "@name" for attributes and "#text" beside them, lists of what repeats."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

from conformance.documents.xml import elements, text_of
from conformance.documents.xml_names import local
from conformance.documents.xml_node import Node
from conformance.documents.xsd_lexical import INTEGERS
from conformance.documents.xsd_shapes import Element, Simple

if TYPE_CHECKING:
    from lxml import etree

_TEXT: Final = "#text"


class NoElementError(ValueError):
    """Raised for a value that no element can have; the message names the member and those that there are."""


def value_of(element: etree._Element) -> Any:
    """Return an element's content: its text, or a mapping if it has attributes or children."""
    found: dict[str, Any] = {f"@{local(str(name))}": value for name, value in element.attrib.items()}
    text = text_of(element).strip()
    children = elements(element)
    if not found and not children:
        return text
    if text:
        found[_TEXT] = text
    for child in children:
        name, value = local(str(child.tag)), value_of(child)
        if name not in found:
            found[name] = value
        elif isinstance(found[name], list):
            found[name].append(value)
        else:
            found[name] = [found[name], value]
    return found


def node_of(declared: Element, value: Any) -> Node:
    """Return an element with a value, its children in the order of the schema; the schema may forbid the value.

    Raises:
        NoElementError: it has a member that the schema does not name, or a list where nothing can repeat.
    """
    kind = declared.type
    attributes = () if isinstance(kind, Simple) else kind.attributes
    if not isinstance(value, Mapping):
        return Node(declared.tag, _text(value, kind if isinstance(kind, Simple) else kind.text))
    known = {f"@{local(name)}" for name, *_ in attributes} | {local(child.tag) for child in declared.children}
    if strange := [name for name in value if name not in known | {_TEXT}]:
        raise NoElementError(f"{local(declared.tag)} has no {strange[0]}, but {', '.join(sorted(known)) or 'nothing'}")
    given = ((tag, simple, value.get(f"@{local(tag)}")) for tag, simple, _ in attributes)
    return Node(
        declared.tag,
        _text(value.get(_TEXT, ""), None),
        tuple(_children(declared, value)),
        tuple((tag, _text(one, simple)) for tag, simple, one in given if one is not None),
    )


def _children(declared: Element, value: Mapping[str, Any]) -> Iterator[Node]:
    for child in declared.children:
        given = value.get(local(child.tag))
        if given is not None:
            yield from (node_of(child, one) for one in (given if isinstance(given, list) else [given]))


def _text(value: Any, simple: Simple | None) -> str:
    """Return a value as XML Schema writes it."""
    if isinstance(value, list | Mapping):
        raise NoElementError(f"{value!r} in place of one value")
    if isinstance(value, bool):
        return str(value).lower()
    whole = simple is not None and simple.builtin in INTEGERS
    return str(int(value)) if whole and isinstance(value, float) and value.is_integer() else str(value)
