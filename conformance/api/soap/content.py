"""What an answer holds, judged by local names: complete or not, and with which values.

The wrapper's child has a name in the contract (``return``), but what it holds is the content, whatever it is called.
"""

import math
import re
from collections.abc import Iterable, Iterator
from typing import Final

from lxml import etree

from conformance.documents.xml import elements, text_of
from conformance.documents.xml_names import local
from conformance.documents.xsd_lexical import FLOATS, INTEGERS
from conformance.documents.xsd_shapes import Element, Simple

# XML Schema 1.0 Part 2, 3.2.5.1 without INF and NaN: those never leave a robot (contract, REST).
_FLOAT: Final = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_INTEGER: Final = re.compile(r"[+-]?[0-9]+")
_SHOWN: Final = 40


def children_of(element: etree._Element, name: str) -> list[etree._Element]:
    """Return the element children of a local name."""
    return [child for child in elements(element) if local(str(child.tag)) == name]


def content_of(wrapper: etree._Element, expected: Element) -> etree._Element | None:
    """Return the element in a response wrapper that holds what the operation returns; None where there is none.

    A message that has the parts of what is expected right in the wrapper is read as well.
    """
    names = {local(child.tag) for child in expected.children}
    inside = elements(wrapper)
    if names and names <= {local(str(child.tag)) for child in inside}:
        return wrapper
    return inside[0] if inside else None


def incomplete(element: etree._Element, expected: Element, where: str = "") -> Iterator[str]:
    """Yield what is missing in an element, or is no value of its type.

    Further elements of the robot's own are let be (contract, fine print).
    """
    kind = expected.type
    if isinstance(kind, Simple):
        yield from _unfit(element, kind, where)
        return
    for child in expected.children:
        path = f"{where}.{local(child.tag)}".removeprefix(".")
        found = _repeated(element, child)
        if len(found) < child.minimum:
            yield f"{path} is missing" if child.maximum == 1 else f"{path} has {len(found)} of {child.minimum} values"
        elif child.maximum is not None and len(found) > child.maximum:
            yield f"{path} stands {len(found)} times"
        for item in found:
            yield from incomplete(item, child, path)


def strings(element: etree._Element, expected: Element, where: str = "") -> Iterator[tuple[str, str]]:
    """Yield the path and the text of each string in an element."""
    if isinstance(expected.type, Simple):
        if expected.type.builtin == "string":
            yield where, text_of(element)
        return
    for child in expected.children:
        for item in _repeated(element, child):
            yield from strings(item, child, f"{where}.{local(child.tag)}".removeprefix("."))


def _repeated(element: etree._Element, child: Element) -> list[etree._Element]:
    """Return the elements for a particle: beside each other, or within one element of its name."""
    found = children_of(element, local(child.tag))
    if child.maximum != 1 and len(found) == 1:
        inside = elements(found[0])
        names = {local(inner.tag) for inner in child.children}
        if inside and not names & {local(str(item.tag)) for item in inside}:
            return inside
    return found


def _unfit(element: etree._Element, kind: Simple, where: str) -> Iterator[str]:
    text = text_of(element).strip()
    if elements(element):
        yield f"{where} has elements where a value should be"
    elif kind.builtin in FLOATS | {"decimal"} and not (_FLOAT.fullmatch(text) and math.isfinite(float(text))):
        yield f"{where} is {text[:_SHOWN]!r}, not a finite number"
    elif kind.builtin in INTEGERS and not _INTEGER.fullmatch(text):
        yield f"{where} is {text[:_SHOWN]!r}, not an integer"
    elif kind.builtin in INTEGERS and _beyond(int(text[:_SHOWN]), kind):
        yield f"{where} is {text[:_SHOWN]}, which is outside {kind.builtin}"


def _beyond(value: int, kind: Simple) -> bool:
    return (kind.minimum is not None and value < kind.minimum) or (kind.maximum is not None and value > kind.maximum)


def items(wrapper: etree._Element, expected: Element) -> list[etree._Element]:
    """Return the items of a list: elements, at any depth, with any of the children of ``expected``."""
    names = {local(child.tag) for child in expected.children}
    found: list[etree._Element] = []
    for child in elements(wrapper):
        if names & {local(str(inner.tag)) for inner in elements(child)}:
            found.append(child)
        else:
            found += items(child, expected)
    return found


def find(element: etree._Element, names: Iterable[str]) -> etree._Element | None:
    """Return the descendant at a path of local names, whose first step may be below elements of other names."""
    path = list(names)
    for start in [element, *(item for item in element.iter() if isinstance(item.tag, str))]:
        here: etree._Element | None = start
        for step in path:
            inside = children_of(here, step) if here is not None else []
            here = inside[0] if inside else None
        if here is not None:
            return here
    return None


def text_at(element: etree._Element, *names: str) -> str | None:
    """Return the text at a path of local names (see find()), or None."""
    found = find(element, names)
    return None if found is None else text_of(found).strip()


def number_at(element: etree._Element, *names: str) -> float | None:
    """Return the finite number at a path of local names (see find()), or None."""
    text = text_at(element, *names)
    if text is None or not _FLOAT.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) else None
