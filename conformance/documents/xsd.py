"""XML Schemas from several documents, compiled by both libxml2 and xmlschema.

A message counts as valid or invalid only if both agree, so that a bug in one of them blames no robot.
"""

from __future__ import annotations

import copy
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from lxml import etree

from conformance.documents.xml_names import XSD, XSI, clark
from conformance.documents.xsd_assembly import SchemaDocument, assemble
from conformance.documents.xsd_budget import beyond_compilers
from conformance.documents.xsd_shapes import Element, shape

_SHOWN: Final = 300
# So deep may the groups of a type lie in each other, those of its base types included.
_DEEPEST: Final = 400
# How xmlschema compiles, in turn: as XSD 1.0, as XSD 1.1, and in spite of errors, which are recorded.
_WAYS: Final = (("XMLSchema10", "strict"), ("XMLSchema11", "strict"), ("XMLSchema10", "lax"))


_TYPE: Final = clark(XSI, "type")
_PATTERN: Final = clark(XSD, "pattern")
# A repeated group with a repetition or alternatives in it.
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

        # By itself it refuses types derived over 15 levels.
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
