"""Find the schemas that would take a compiler more memory or time than there is, before one sees them.

A few kilobytes suffice for that: compilers unroll groups, repeat the particles of base types, and follow references
by recursion.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from lxml import etree

from conformance.documents.xml_names import XSD, clark
from conformance.documents.xsd_assembly import SchemaDocument, kind_of, references
from conformance.documents.xsd_unknown import Component

# The compilers build an automaton for each type, of a size that may be the square of its particles; a group counts as
# often as it is referred to, and a base type for each type that is derived from it.
_MOST_PARTICLES: Final = 1_000
# The squares of all types together: some 100 bytes and two microseconds each.
_MOST_SQUARES: Final = 20_000_000
# A group is unrolled as often as it occurs at least, in nearly 40 kB for each particle.
_MOST_UNROLLED: Final = 10_000
# So many components may each refer to the next one: compilers follow them by recursion.
_MOST_CHAINED: Final = 150
_LONGEST_PATTERN: Final = 5_000
# Groups, quantifiers and alternatives of a pattern: time grows with their cube; and of all patterns together.
_MOST_OPERATORS: Final = 900
_MOST_OPERATORS_OF_ALL: Final = 20_000
_OPERATOR: Final = re.compile(r"\\.|\[(?:\\.|[^\]\\])*\]|([(*+?{|])", re.DOTALL)

_PATTERN, _UNION, _EXTENSION = (clark(XSD, name) for name in ("pattern", "union", "extension"))
_GROUPS: Final = tuple(clark(XSD, name) for name in ("group", "attributeGroup"))
_PARTICLES: Final = tuple(clark(XSD, name) for name in ("element", "any", "attribute", "group", "attributeGroup"))
_MODELS: Final = tuple(clark(XSD, name) for name in ("sequence", "choice", "all", "group"))


def beyond_compilers(documents: Sequence[SchemaDocument]) -> str:
    """Return why no compiler can be given some documents; empty if one can."""
    found: dict[Component, etree._Element] = {}
    uses: dict[Component, list[Component]] = {}
    for document in documents:
        for whole in document.root.iterchildren(etree.Element):
            if whole.get("name"):
                component = Component(kind_of(whole.tag), document.namespace, whole.get("name", ""))
                found.setdefault(component, whole)
                uses.setdefault(component, []).extend(references(whole, document.namespace))
    return (
        next(filter(None, (_unrolled(one.root) for one in documents)), "")
        or _patterns(documents)
        or _chain(uses)
        or _sizes(found)
    )


def _unrolled(root: etree._Element) -> str:
    for model in root.iter(*_MODELS):
        around = [model]
        for outer in model.iterancestors():  # as far as the type, which has an automaton of its own
            if outer.tag not in _MODELS:
                break
            around.append(outer)
        repeated = math.prod(map(_times, around))
        if repeated > 1 and repeated * sum(1 for _ in model.iter(*_PARTICLES)) > _MOST_UNROLLED:
            owner = next((outer.get("name") for outer in model.iterancestors() if outer.get("name")), "a type")
            return f"the repeated groups of {owner} have more than {_MOST_UNROLLED:,} elements, unrolled"
    return ""


def _times(model: etree._Element) -> int:
    """Return how often a group of particles is repeated at least; for the rest, compilers have counters."""
    least = model.get("minOccurs", "1")
    return max(int(least[:9]), 1) if least.isascii() and least.isdigit() else 1


def _patterns(documents: Sequence[SchemaDocument]) -> str:
    total = 0
    for pattern in [one for document in documents for one in document.root.iter(_PATTERN)]:
        text = pattern.get("value", "")
        operators = sum(1 for one in _OPERATOR.finditer(text) if one[1])
        if len(text) > _LONGEST_PATTERN or operators > _MOST_OPERATORS:
            return f"a pattern of {len(text):,} characters and {operators:,} groups, quantifiers and alternatives"
        total += operators
    if total > _MOST_OPERATORS_OF_ALL:
        return f"patterns of {total:,} groups, quantifiers and alternatives; the limit is {_MOST_OPERATORS_OF_ALL:,}"
    return ""


def _chain(uses: Mapping[Component, Sequence[Component]]) -> str:
    """Return which component begins a chain of more than the allowed number; empty if there is none."""
    depths: dict[Component, int] = {}
    for start, first in uses.items():
        # What is under way has no depth yet: a type within itself is no longer chain.
        waiting: list[tuple[Component, Iterator[Component]]] = [(start, iter(first))]
        under_way = {start}
        while waiting:
            component, rest = waiting[-1]
            deeper = next((one for one in rest if one in uses and one not in depths and one not in under_way), None)
            if deeper is not None:
                waiting.append((deeper, iter(uses[deeper])))
                under_way.add(deeper)
                continue
            waiting.pop()
            under_way.discard(component)
            depths[component] = 1 + max((depths.get(one, 0) for one in uses[component]), default=0)
            if depths[component] > _MOST_CHAINED:
                return f"{component.kind} {component.name} begins a chain of more than {_MOST_CHAINED} types"
    return ""


def _sizes(found: Mapping[Component, etree._Element]) -> str:
    """Return which component has more particles or member types than allowed, or that all together have."""
    sizes: dict[Component, int] = {}

    def size(component: Component) -> int:
        if component not in sizes:
            sizes[component] = 1  # of a component within itself
            sizes[component] = max(sum(_parts(found[component])), found[component].tag.endswith("simpleType"))
        return sizes[component]

    def _parts(whole: etree._Element) -> Iterator[int]:
        for part in whole.iter(*_PARTICLES, _UNION, _EXTENSION):
            refers = part.tag in {_UNION, _EXTENSION} or (part.tag in _GROUPS and part.get("ref"))
            inner = list(references(part, spaces[whole.getroottree().getroot()], deep=False)) if refers else []
            yield from (size(one) if one in found else 1 for one in inner)
            if not refers:
                yield 1

    spaces = {one.getroottree().getroot(): component.space for component, one in found.items()}
    for component in found:
        if size(component) > _MOST_PARTICLES:
            of = f"{component.kind} {component.name}"
            return f"{of} has more than {_MOST_PARTICLES:,} elements or attributes, groups included"
    if sum(size(one) ** 2 for one in found) <= _MOST_SQUARES:
        return ""
    return f"its {len(found):,} types have {sum(map(size, found)):,} elements and attributes, those of bases included"
