"""XML Schemas from several documents, compiled by both libxml2 and xmlschema.

A message counts as valid or invalid only if both agree, so that a bug in one of them blames no robot.
"""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from lxml import etree

from conformance.documents.xml_names import XSD, clark
from conformance.documents.xsd_shapes import Element, shape

_IMPORT: Final = clark(XSD, "import")
_INCLUDE: Final = clark(XSD, "include")
_SCHEMA: Final = clark(XSD, "schema")
_SHOWN: Final = 300


class SchemaError(ValueError):
    """Raised for schemas that do not compile; the message is the compiler's."""


@dataclass(frozen=True)
class SchemaDocument:
    """One xs:schema.

    Attributes:
        location: its URL or file name; for an inline schema, that of the WSDL with a fragment.
        root: the xs:schema element.
        inline: whether it is inside wsdl:types.
    """

    location: str
    root: etree._Element
    inline: bool = False

    @property
    def namespace(self) -> str:
        """The targetNamespace; empty without one."""
        return self.root.get("targetNamespace") or ""


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
        self._errors = xmlschema.XMLSchemaException
        self._shapes: dict[str, Element | None] = {}
        with tempfile.TemporaryDirectory(prefix="roaas-xsd-") as folder:
            entry = _assemble(documents, Path(folder))
            try:
                self.libxml = etree.XMLSchema(file=str(entry))
            except etree.LxmlError as error:
                self.problems.append(f"libxml2: {str(error)[:_SHOWN]}")
            try:
                self.python = xmlschema.XMLSchema10(str(entry), allow="local")
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
        key = tuple(etree.tostring(document.root) for document in documents)
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
        """Return why libxml2 finds an element invalid; empty if it is valid or libxml2 rejected the schemas."""
        if self.libxml is None or self.libxml.validate(element):
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
        first = self.libxml_problem(element)
        if self.libxml is not None and not first:
            return ""
        second = self.python_problem(element)
        return (first or second)[:_SHOWN] if second else ""

    def valid(self, element: etree._Element) -> bool:
        """Return whether both find the element valid."""
        return not self.libxml_problem(element) and not self.python_problem(element)


_COMPILED: Final[dict[tuple[bytes, ...], Types]] = {}


def _assemble(documents: Sequence[SchemaDocument], folder: Path) -> Path:
    """Write the documents into a folder with an entry document that imports them all; return its path.

    libxml2 loads one document per imported namespace, so each namespace gets one that includes all its documents.
    """
    spaces = sorted({document.namespace for document in documents if not _only_imports(document)})
    collected = {space: f"namespace{number}.xsd" for number, space in enumerate(spaces)}
    members: dict[str, list[str]] = {space: [] for space in spaces}
    for number, document in enumerate(documents):
        if not _only_imports(document):
            members[document.namespace].append(f"document{number}.xsd")
            (folder / f"document{number}.xsd").write_bytes(_relocated(document.root, collected))
    for space, names in members.items():
        (folder / collected[space]).write_bytes(_schema_of(space, includes=names))
    imports = {space: place for space, place in collected.items() if space}
    entry = folder / "entry.xsd"
    entry.write_bytes(_schema_of("", includes=members.get("", []), imports=imports))
    return entry


def _relocated(schema: etree._Element, collected: dict[str, str]) -> bytes:
    """Return a schema document whose imports refer to the written files, without includes."""
    # An inline schema may use prefixes that the WSDL around it declares. A copy loses them, a text has them.
    root = etree.fromstring(etree.tostring(schema, with_tail=False))
    for reference in [*root.iter(_IMPORT), *root.iter(_INCLUDE)]:
        space = reference.get("namespace") or ""
        if reference.tag == _INCLUDE:
            root.remove(reference)
        elif space in collected:
            reference.set("schemaLocation", collected[space])
        elif "schemaLocation" in reference.attrib:
            del reference.attrib["schemaLocation"]
    return etree.tostring(root, with_tail=False)


def _schema_of(space: str, *, includes: Sequence[str], imports: Mapping[str, str] | None = None) -> bytes:
    root = etree.Element(_SCHEMA, {"targetNamespace": space} if space else {}, nsmap={"xs": XSD})
    for name in includes:
        etree.SubElement(root, _INCLUDE, schemaLocation=name)
    for other, name in (imports or {}).items():
        etree.SubElement(root, _IMPORT, namespace=other, schemaLocation=name)
    return etree.tostring(root)


def _only_imports(document: SchemaDocument) -> bool:
    """Return whether a schema document consists of imports only, as WSDL tools write it into wsdl:types (R2105)."""
    return not document.namespace and all(
        child.tag == _IMPORT for child in document.root if isinstance(child.tag, str) and "annotation" not in child.tag
    )
