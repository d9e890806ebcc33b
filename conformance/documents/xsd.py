"""XML Schemas from several documents, compiled by both libxml2 and xmlschema.

A message counts as valid or invalid only if both agree, so that a bug in one of them blames no robot. Schemas that
would take too much memory or time are refused before they are compiled.
"""

from __future__ import annotations

import copy
import math
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from lxml import etree

from conformance.documents.xml import XSD, XSI, clark
from conformance.documents.xsd_assembly import LEFT_OUT, Component, SchemaDocument, assemble, kind_of, references
from conformance.documents.xsd_shapes import Element, shape

_SHOWN: Final = 300
# Deepest nesting of the groups of a type and its base types.
_DEEPEST: Final = 400
# How xmlschema compiles, in this order: as XSD 1.0, as XSD 1.1, and leniently, with its errors recorded.
_WAYS: Final = (("XMLSchema10", "strict"), ("XMLSchema11", "strict"), ("XMLSchema10", "lax"))


_TYPE: Final = clark(XSI, "type")
_PATTERN: Final = clark(XSD, "pattern")
# A repeated group that contains a repetition or alternatives: matching may take exponential time.
_SLOW: Final = re.compile(r"\((?:.*[+*}|].*)\)[+*{]", re.DOTALL)


class SchemaError(ValueError):
    """Raised for schemas that do not compile; the message is the compiler's."""


class Types:
    """Compiled schemas.

    Args:
        documents: all schema documents; their schemaLocation attributes are ignored.

    Raises:
        SchemaError: neither compiler accepts them.
    """

    def __init__(self, documents: Sequence[SchemaDocument]) -> None:
        # Imported late: it takes a sixth of a second, and nothing is compiled before the robot is on its way to a goal.
        import xmlschema  # noqa: PLC0415

        # The library's own default refuses types derived over 15 levels.
        xmlschema.limits.MAX_MODEL_DEPTH = _DEEPEST
        self.libxml: etree.XMLSchema | None = None
        self.python: Any = None
        self.problems: list[str] = []
        self.is_11 = False
        self._errors = xmlschema.XMLSchemaException
        self._shapes: dict[str, Element | None] = {}
        if problem := beyond_compilers(documents):
            raise SchemaError(problem)
        with tempfile.TemporaryDirectory(prefix="roaas-xsd-") as folder:
            try:
                assembly = assemble(documents, Path(folder))
            except (etree.LxmlError, ValueError, RecursionError) as error:
                raise SchemaError(f"{type(error).__name__}: {error}"[:_SHOWN]) from error
            self.unknown, self.twice = tuple(assembly.unknown), tuple(assembly.twice)
            try:
                self.libxml = etree.XMLSchema(file=str(assembly.entry))
            except etree.LxmlError as error:
                self.problems.append(f"libxml2: {str(error)[:_SHOWN]}")
            self._one_judge = _without_slow_patterns(Path(folder))
            for version, how in _WAYS:
                try:
                    self.python = getattr(xmlschema, version)(str(assembly.entry), allow="local", validation=how)
                    self.is_11 = version == "XMLSchema11"
                    break
                except (xmlschema.XMLSchemaException, ValueError, OSError, RecursionError) as error:
                    self.problems.append(f"xmlschema: {' '.join(str(error).split())[:_SHOWN]}")
        if self.python is None:
            raise SchemaError("; ".join(self.problems))

    @classmethod
    def compile(cls, documents: Sequence[SchemaDocument]) -> Types:
        """Return the compiled schemas, cached per process, because compiling takes 0.1 s.

        Raises:
            SchemaError: neither compiler accepts them.
        """
        key = tuple((document.location, etree.tostring(document.root)) for document in documents)
        if key not in _COMPILED:
            _COMPILED[key] = cls(documents)
        return _COMPILED[key]

    def shape(self, tag: str) -> Element | None:
        """Return the global element with a tag, or None.

        Raises:
            SchemaError: its types lie too deep in each other.
        """
        if tag not in self._shapes:
            declared = self.python.maps.elements.get(tag)
            try:
                self._shapes[tag] = None if declared is None else shape(declared)
            except (self._errors, RecursionError) as error:
                raise SchemaError(f"the types of {tag} lie too deep in each other: {error}"[:_SHOWN]) from error
        return self._shapes[tag]

    def libxml_problem(self, element: etree._Element) -> str:
        """Return why libxml2 finds an element invalid; empty if it is valid, or libxml2 cannot tell."""
        try:
            if self.libxml is None or self.libxml.validate(element):
                return ""
        except etree.LxmlError:  # a pattern that needs more steps than libxml2 allows
            return ""
        log: Any = self.libxml.error_log
        return str(log[0].message) if len(log) else "invalid"

    def python_problem(self, element: etree._Element) -> str:
        """Return why an element is invalid according to xmlschema; empty if it is valid."""
        # Copy the element alone, because its surroundings are not validated. Drop comments, because xmlschema ends a
        # value at the first one.
        alone = copy.deepcopy(element)
        etree.strip_tags(alone, etree.Comment, etree.PI)
        try:
            error = next(iter(self.python.iter_errors(alone)), None)
        except (self._errors, ValueError, ArithmeticError, RecursionError) as problem:
            return f"{type(problem).__name__}: {problem}"[:_SHOWN]
        return "" if error is None else str(getattr(error, "reason", "") or "invalid")

    def invalid(self, element: etree._Element) -> str:
        """Return why an element is invalid according to both; empty if either finds it valid."""
        if self.unknown:
            element = self._without_unknown_types(element)
        first = self.libxml_problem(element)
        if self.libxml is not None and not first:
            return ""
        if self._one_judge and "[facet 'pattern']" in first:
            return first[:_SHOWN]
        second = self.python_problem(element)
        return (first or second)[:_SHOWN] if second else ""

    def _without_unknown_types(self, element: etree._Element) -> etree._Element:
        """Return a copy without any xsi:type whose type no document declares."""
        alone, spaces = copy.deepcopy(element), {component.space for component in self.unknown}
        for one in alone.iter(etree.Element):
            prefix, _, name = one.get(_TYPE, "").strip().rpartition(":")
            space = one.nsmap.get(prefix or None)
            if space in spaces and clark(space, name) not in self.python.maps.types:
                del one.attrib[_TYPE]
        return alone

    def valid(self, element: etree._Element) -> bool:
        """Return whether both find the element valid."""
        return not self.libxml_problem(element) and not self.python_problem(element)


_COMPILED: Final[dict[tuple[tuple[str, bytes], ...], Types]] = {}


def _without_slow_patterns(folder: Path) -> bool:
    """Leave out the patterns that Python may take exponential time for; return whether there are any.

    libxml2, which has read them before, judges them by an automaton.
    """
    found = False
    for path in folder.glob("*.xsd"):
        root = etree.parse(path).getroot()
        for pattern in [item for item in root.iter(_PATTERN) if _SLOW.search(item.get("value", ""))]:
            parent = pattern.getparent()
            if parent is not None:
                parent.remove(pattern)
                parent.set(LEFT_OUT, pattern.get("value", ""))
                found = True
        if found:
            path.write_bytes(etree.tostring(root))
    return found


# Most particles of a type: an automaton may grow with their square. A group counts for each use, and a base type
# for each derived type.
_MOST_PARTICLES: Final = 1_000
# Sum of the squared particles of all types: some 100 bytes and two microseconds each.
_MOST_SQUARES: Final = 20_000_000
# Particles of a group times its minOccurs: compilers unroll it, in nearly 40 kB for each.
_MOST_UNROLLED: Final = 10_000
_MOST_CHAINED: Final = 150  # components in a chain of references, which compilers follow recursively
_LONGEST_PATTERN: Final = 5_000  # longest pattern, characters
# Most groups, quantifiers and alternatives of one pattern, and of all. Time grows with the cube of their number.
_MOST_OPERATORS: Final = 900
_MOST_OPERATORS_OF_ALL: Final = 20_000
_OPERATOR: Final = re.compile(r"\\.|\[(?:\\.|[^\]\\])*\]|([(*+?{|])", re.DOTALL)

_UNION, _EXTENSION = clark(XSD, "union"), clark(XSD, "extension")
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
        next(filter(None, (_repeat_fault(one.root) for one in documents)), "")
        or _patterns(documents)
        or _chain(uses)
        or _sizes(found)
    )


def _repeat_fault(root: etree._Element) -> str:
    for model in root.iter(*_MODELS):
        around = [model]
        for outer in model.iterancestors():  # only up to the type, which has an automaton of its own
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
    for pattern in [element for document in documents for element in document.root.iter(_PATTERN)]:
        text = pattern.get("value", "")
        operators = sum(1 for match in _OPERATOR.finditer(text) if match[1])
        if len(text) > _LONGEST_PATTERN or operators > _MOST_OPERATORS:
            return f"a pattern of {len(text):,} characters and {operators:,} groups, quantifiers and alternatives"
        total += operators
    if total > _MOST_OPERATORS_OF_ALL:
        return f"patterns of {total:,} groups, quantifiers and alternatives; the limit is {_MOST_OPERATORS_OF_ALL:,}"
    return ""


def _chain(uses: Mapping[Component, Sequence[Component]]) -> str:
    """Return the component at the start of a chain that is too long; empty if there is none."""
    depths: dict[Component, int] = {}
    for start, first in uses.items():
        # A component that is still being measured has no depth yet: a recursive type makes no longer chain.
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
            sizes[component] = 1  # used where a component contains itself
            sizes[component] = max(sum(_parts(found[component])), found[component].tag.endswith("simpleType"))
        return sizes[component]

    def _parts(whole: etree._Element) -> Iterator[int]:
        for part in whole.iter(*_PARTICLES, _UNION, _EXTENSION):
            refers = part.tag in {_UNION, _EXTENSION} or (part.tag in _GROUPS and part.get("ref"))
            inner = list(references(part, spaces[whole.getroottree().getroot()], deep=False)) if refers else []
            yield from (size(component) if component in found else 1 for component in inner)
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
