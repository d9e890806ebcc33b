"""XML Schemas from several documents, compiled by both libxml2 and xmlschema.

A message counts as valid or invalid only if both agree, so that a bug in one of them blames no robot.
"""

from __future__ import annotations

import copy
import math
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from lxml import etree

from conformance.documents.xml_names import XSD, XSI, clark
from conformance.documents.xsd_assembly import SchemaDocument, assemble
from conformance.documents.xsd_shapes import Element, shape

_SHOWN: Final = 300
# How xmlschema compiles, in turn: as XSD 1.0, as XSD 1.1, and in spite of errors, which are recorded.
_WAYS: Final = (("XMLSchema10", "strict"), ("XMLSchema11", "strict"), ("XMLSchema10", "lax"))


_TYPE: Final = clark(XSI, "type")
_PATTERN: Final = clark(XSD, "pattern")
# A repeated group with a repetition or alternatives in it.
_SLOW: Final = re.compile(r"\((?:.*[+*}|].*)\)[+*{]", re.DOTALL)


# The compilers build an automaton for each type, of a size that may be the square of its particles; a group counts as
# often as it is referred to.
_MOST_PARTICLES: Final = 1_000
_DEEPEST: Final = 100
# A group is unrolled as often as it occurs at least, in nearly 40 kB for each particle.
_MOST_UNROLLED: Final = 10_000
# So many types may each be derived from the next one, or have a member of it.
_MOST_CHAINED: Final = 150
_LONGEST_PATTERN: Final = 5_000
_MOST_GROUPS: Final = 300
_MODELS: Final = tuple(clark(XSD, name) for name in ("sequence", "choice", "all", "group"))
_REFERENCES: Final = ("type", "base", "itemType")
_PARTICLES: Final = tuple(clark(XSD, name) for name in ("element", "any", "attribute", "group", "attributeGroup"))


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

        self.libxml: etree.XMLSchema | None = None
        self.python: Any = None
        self.problems: list[str] = []
        self.is_11 = False
        self._errors = xmlschema.XMLSchemaException
        self._shapes: dict[str, Element | None] = {}
        if name := _too_large(documents):
            raise SchemaError(f"{name} has more than {_MOST_PARTICLES:,} elements or attributes, groups included")
        if problem := _beyond_compilers(documents):
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
    def compiled(cls, documents: Sequence[SchemaDocument]) -> Types:
        """Return the compiled schemas, cached per process, because compiling takes 0.1 s.

        Raises:
            SchemaError: neither compiler accepts them.
        """
        key = tuple((document.location, etree.tostring(document.root)) for document in documents)
        if key not in _COMPILED:
            _COMPILED[key] = cls(documents)
        return _COMPILED[key]

    def shape(self, tag: str) -> Element | None:
        """Return the global element with a tag, or None."""
        if tag not in self._shapes:
            declared = self.python.maps.elements.get(tag)
            self._shapes[tag] = None if declared is None else shape(declared)
        return self._shapes[tag]

    def libxml_problem(self, element: etree._Element) -> str:
        """Return why libxml2 finds an element invalid; empty if it is valid, or libxml2 cannot tell."""
        try:
            if self.libxml is None or self.libxml.validate(element):
                return ""
        except etree.LxmlError:  # a pattern that takes more steps than libxml2 makes
            return ""
        log: Any = self.libxml.error_log
        return str(log[0].message) if len(log) else "invalid"

    def python_problem(self, element: etree._Element) -> str:
        """Return why an element is invalid according to xmlschema; empty if it is valid."""
        # A copy, because what stands around the element is none of the schema's business; without comments, because
        # xmlschema takes a value to end at the first one.
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
        """Return a copy without each xsi:type that names a type of which no document is there."""
        alone, spaces = copy.deepcopy(element), {one.space for one in self.unknown}
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


def _too_large(documents: Sequence[SchemaDocument]) -> str:
    """Return the name of a type or group that no compiler can be given; empty if there is none."""
    wholes = [whole for one in documents for whole in one.root.iterchildren(etree.Element)]
    groups = {(whole.tag, whole.get("name")): whole for whole in wholes}
    sizes: dict[etree._Element, int] = {}

    def size(whole: etree._Element, depth: int = 0) -> int:
        if whole not in sizes:
            sizes[whole] = 1  # of a group within itself
            total = 0
            for part in whole.iter(*_PARTICLES):
                group = groups.get((part.tag, part.get("ref", "").rpartition(":")[2])) if part.get("ref") else None
                is_group = group is not None and part.tag.endswith("roup") and depth <= _DEEPEST
                total += size(group, depth + 1) if group is not None and is_group else 1
                if total > _MOST_PARTICLES:
                    break
            sizes[whole] = total
        return sizes[whole]

    found = next((one for one in wholes if size(one) > _MOST_PARTICLES), None)
    return "" if found is None else f"{etree.QName(found).localname} {found.get('name')}"


def _beyond_compilers(documents: Sequence[SchemaDocument]) -> str:
    """Return what would take a compiler more memory or time than there is; empty if there is nothing."""
    for one in documents:
        for model in one.root.iter(*_MODELS):
            around = [model, *(outer for outer in model.iterancestors() if outer.tag in _MODELS)]
            repeated = math.prod(map(_times, around))
            if repeated > 1 and repeated * sum(1 for _ in model.iter(*_PARTICLES)) > _MOST_UNROLLED:
                owner = next((outer.get("name") for outer in model.iterancestors() if outer.get("name")), "a type")
                return f"the repeated groups of {owner} have more than {_MOST_UNROLLED:,} elements, unrolled"
        for pattern in one.root.iter(_PATTERN):
            text = pattern.get("value", "")
            if len(text) > _LONGEST_PATTERN or text.count("(") > _MOST_GROUPS:
                return f"a pattern of {len(text):,} characters and {text.count('('):,} groups"
    chain = _longest_chain([whole for one in documents for whole in one.root.iterchildren(etree.Element)])
    return f"type {chain} begins a chain of more than {_MOST_CHAINED} types" if chain else ""


def _times(model: etree._Element) -> int:
    """Return how often a group of particles is repeated at least; for the rest, compilers have counters."""
    least = model.get("minOccurs", "1")
    return max(int(least), 1) if least.isascii() and least.isdigit() else 1


def _longest_chain(wholes: Sequence[etree._Element]) -> str:
    """Return the name of a type from which more than the allowed number of types follow each other, or nothing."""
    types = {str(whole.get("name")): whole for whole in wholes if whole.get("name") and whole.tag.endswith("Type")}
    nexts = {
        name: {
            target
            for part in whole.iter(etree.Element)
            for word in _REFERENCES
            if (target := part.get(word, "").rpartition(":")[2]) in types and target != name
        }
        for name, whole in types.items()
    }
    depths: dict[str, int] = {}
    for start, first in nexts.items():
        # What is under way has no depth yet: a type within itself is no longer chain.
        waiting, under_way = [(start, iter(first))], {start}
        while waiting:
            name, rest = waiting[-1]
            deeper = next((one for one in rest if one not in depths and one not in under_way), None)
            if deeper is not None:
                waiting.append((deeper, iter(nexts[deeper])))
                under_way.add(deeper)
                continue
            waiting.pop()
            under_way.discard(name)
            depths[name] = 1 + max((depths.get(one, 0) for one in nexts[name]), default=0)
            if depths[name] > _MOST_CHAINED:
                return name
    return ""


def _without_slow_patterns(folder: Path) -> bool:
    """Leave out the patterns that Python may take exponential time for; return whether there are any.

    libxml2, which has read them before, judges them by an automaton.
    """
    found = False
    for path in folder.glob("*.xsd"):
        root = etree.parse(path).getroot()
        for pattern in [one for one in root.iter(_PATTERN) if _SLOW.search(one.get("value", ""))]:
            parent = pattern.getparent()
            if parent is not None:
                parent.remove(pattern)
                found = True
        if found:
            path.write_bytes(etree.tostring(root))
    return found
