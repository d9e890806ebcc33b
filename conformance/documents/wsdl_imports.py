"""Collect the documents of a WSDL by its imports and those of its schemas, each once, and report the missing ones."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from html import unescape
from pathlib import Path, PurePosixPath
from typing import Final
from urllib.parse import urlsplit

from lxml import etree

from conformance.commandline.device_options import advice
from conformance.documents.xml import WSDL, XSD, NotXmlError, clark, namespace, parse
from conformance.documents.xsd import Types
from conformance.documents.xsd_assembly import SchemaDocument, location_of

# Function that returns a document by its resolved location. It raises OSError or ValueError with the reason.
Fetch = Callable[[str], bytes]
# Function that returns the location of a namespace's schema, or an empty text.
Locate = Callable[[str], str]
_MOST: Final = 50  # documents that a description may refer to
_HEAD: Final = 1000  # bytes in which a DOCTYPE is looked for
_SHOWN: Final = 80
_TITLE: Final = re.compile(rb"<title[^>]*>([^<]*)", re.IGNORECASE)


@dataclass
class Collected:
    """The documents of a description.

    Attributes:
        definitions: wsdl:definitions elements.
        schemas: schema documents.
        missing: reasons why documents are missing, by location.
        imported: namespaces that schemas import, each with the location that one of them gives, or empty.
    """

    definitions: list[etree._Element] = field(default_factory=list)
    schemas: list[SchemaDocument] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    imported: dict[str, str] = field(default_factory=dict)

    @property
    def lacking(self) -> list[str]:
        """The imported namespaces of which no document was found."""
        there = {schema.namespace for schema in self.schemas} | {XSD}
        return [space for space in self.imported if space and space not in there]


def collect(wsdl: bytes, location: str, fetch: Fetch, locate: Locate = lambda _: "") -> Collected:
    """Return all documents of a description.

    Args:
        wsdl: the first document.
        location: its URL or file name, the base of relative references.
        fetch: returns a further document by its resolved location.
        locate: returns where the schema of a namespace is to which no reference led.

    Raises:
        ValueError: the first one is not a WSDL; the message says why.
    """
    root, found = _root_of(wsdl), Collected()
    waiting = _take(found, location, root)
    seen = {location, ""}
    while waiting:
        target = waiting.pop(0)
        if target not in seen:
            seen.add(target)
            if len(seen) > _MOST:
                found.missing[target] = f"more than {_MOST} documents"
                return found
            try:
                waiting += _take(found, target, parse(fetch(target), doctype=True))
            except (OSError, ValueError) as error:
                found.missing[target] = str(error) or type(error).__name__
        if not waiting:
            waiting = [place for place in map(locate, found.lacking) if place not in seen]
    return found


def _root_of(wsdl: bytes) -> etree._Element:
    """Return the root of a WSDL.

    Raises:
        ValueError: it is not one; the message says what it is.
    """
    # WSDL 1.1 allows a DOCTYPE, so it is no fault; the suite does not read it.
    head = wsdl[:_HEAD].lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    if not head:
        raise ValueError("an empty document")
    if head.startswith((b"{", b"[")):
        raise ValueError("JSON" + advice(": an OpenAPI description goes with --openapi"))
    try:
        root = parse(wsdl, doctype=True)
        problem = f"the root element {root.tag} instead of wsdl:definitions"
    except NotXmlError as error:
        root, problem = None, str(error)
    if root is not None and root.tag == clark(WSDL, "definitions"):
        return root
    if head.startswith((b"<!doctype html", b"<html")):
        title = _TITLE.search(wsdl)
        said = " ".join(unescape(title[1].decode("utf-8", "replace")).split())[:_SHOWN] if title else ""
        problem = f"an HTML page, such as a login or an error{f', with the title {said!r}' if said else ''}: {problem}"
    if root is not None and root.tag == "{http://www.w3.org/ns/wsdl}description":
        problem = "a WSDL 2.0, which the suite does not read: it reads WSDL 1.1"
    raise ValueError(problem)


def _take(found: Collected, place: str, root: etree._Element) -> list[str]:
    """Add a document, and return the locations that it refers to."""
    # Entities are not expanded; the compilers get copies without a DOCTYPE.
    etree.strip_elements(root, etree.Entity, with_tail=False)
    targets: list[str] = []
    if root.tag == clark(WSDL, "definitions"):
        found.definitions.append(root)
        references = [element.get("location") for element in root.findall(clark(WSDL, "import"))]
        targets += [location_of(place, reference) for reference in references if reference]
        for number, schema in enumerate(root.iterfind(f"{clark(WSDL, 'types')}/{clark(XSD, 'schema')}")):
            found.schemas.append(SchemaDocument(f"{place}#{number}", schema, inline=True))
            targets += _schema_references(found)
    elif root.tag == clark(XSD, "schema"):
        found.schemas.append(SchemaDocument(place, root))
        targets += _schema_references(found)
    else:
        found.missing[place] = f"neither a WSDL nor a schema, but {root.tag}"
    # A namespace without any reference may still be found by its name.
    return [*targets, ""]


def _schema_references(found: Collected) -> Iterator[str]:
    """Yield the locations to which the last schema refers, and record its imports."""
    schema = found.schemas[-1]
    for element in schema.root.iterchildren(
        *(clark(XSD, name) for name in ("import", "include", "redefine", "override"))
    ):
        reference = element.get("schemaLocation") or ""
        target = location_of(schema.location, reference) if reference else ""
        if element.tag == clark(XSD, "import"):
            space = element.get("namespace") or ""
            found.imported[space] = found.imported.get(space) or target
        yield target


@dataclass(frozen=True)
class SchemaFolder:
    """A folder with schemas for references that lead nowhere.

    Attributes:
        folder: the folder; its subfolders count too.
    """

    folder: Path

    @cached_property
    def _files(self) -> dict[Path, str]:
        """The documents in the folder, each with its target namespace; without one, an empty text."""
        found: dict[Path, str] = {}
        for path in sorted(one for one in self.folder.rglob("*") if one.is_file()):
            try:
                root = parse(path.read_bytes(), doctype=True)
            except (OSError, NotXmlError):
                continue
            if root.tag in {clark(XSD, "schema"), clark(WSDL, "definitions")}:
                found[path] = (root.get("targetNamespace") or "") if root.tag == clark(XSD, "schema") else ""
        return found

    def at(self, place: str) -> bytes | None:
        """Return the document whose path ends as a location does, with or without `.xsd`, or None."""
        wanted = PurePosixPath(urlsplit(place).netloc + urlsplit(place).path).parts[::-1]

        def fits(path: Path) -> int:
            parts = path.relative_to(self.folder).parts[::-1]
            if not wanted or parts[0] not in {wanted[0], f"{wanted[0]}.xsd"}:
                return 0
            pairs = zip(wanted[1:], parts[1:], strict=False)
            return 1 + next((number for number, (one, other) in enumerate(pairs) if one != other), len(parts))

        best = max(self._files, key=fits, default=None)
        return best.read_bytes() if best is not None and fits(best) else None

    def locate(self, space: str) -> str:
        """Return the path of the schema of a namespace; empty if there is none."""
        return next((str(path) for path, own in self._files.items() if own == space), "")


# Error texts of libxml2 and xmlschema for content models that break unique particle attribution.
_AMBIGUOUS: Final = ("determinist", "Unique Particle Attribution")


def gaps(
    found: Collected, types: Types, location: str, named: Iterable[tuple[str, str]]
) -> tuple[list[str], list[str]]:
    """Return the faults of a WSDL's documents, and the gaps that are no fault of the device.

    A device is to blame for the documents on its own server, and for names that no document declares.

    Args:
        found: the documents.
        types: their schemas, compiled.
        location: the location of the WSDL.
        named: who names an element in a message, and its tag.
    """
    own = f"{location.partition('://')[0]}://{urlsplit(location).netloc}/" if "://" in location else ""
    gone = {place: why for place, why in found.missing.items() if own and place.startswith(own)}
    faults = [f"{place} could not be read: {reason}" for place, reason in gone.items()]
    as_any = f"What it declares counts as any content{advice('; give its folder by --schemas')}."
    notes = [
        f"{place} could not be read: {reason}. {as_any}" for place, reason in found.missing.items() if place not in gone
    ]
    for space in found.lacking:
        if not found.imported[space] and any(component.space == space for component in types.unknown):
            notes += [f"No location leads to a schema of {space}. {as_any}"]
    if not found.missing:
        faults += [
            f"its schemas name the {component.kind} {component.tag}, which no document declares"
            for component in types.unknown
            if component.space not in found.lacking
        ]
    faults += [
        f"{who} names the element {tag}, which no schema declares"
        for who, tag in named
        if types.shape(tag) is None and namespace(tag) not in found.lacking
    ]
    faults += [
        f"two of its schemas declare the {component.kind} {component.tag}, each in its own way"
        for component in types.twice
    ]
    if types.is_11 or (types.problems and all(any(words in one for words in _AMBIGUOUS) for one in types.problems)):
        notes.append(f"Its schemas are ambiguous or XSD 1.1, and one of two validators judges: {types.problems[0]}")
    else:
        faults += [f"its schemas are refused by one of two compilers: {problem}" for problem in types.problems]
    return faults, notes
