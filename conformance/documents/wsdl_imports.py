"""Collect the documents of a WSDL by wsdl:import, xsd:import and xsd:include, each once."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from urllib.parse import urljoin

from lxml import etree

from conformance.documents.xml import NotXmlError, parse
from conformance.documents.xml_names import WSDL, XSD, clark
from conformance.documents.xsd import SchemaDocument

# Obtains a document by its resolved location. Raises OSError or ValueError with the reason where it cannot.
Fetch = Callable[[str], bytes]
# More documents than this are no description of a robot, but a robot that keeps its reader busy.
_MOST: Final = 50


@dataclass
class Collected:
    """The documents of a description.

    Attributes:
        definitions: wsdl:definitions elements.
        schemas: schema documents.
        missing: reasons why documents are missing, by location.
    """

    definitions: list[etree._Element] = field(default_factory=list)
    schemas: list[SchemaDocument] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)


def collect(wsdl: bytes, location: str, fetch: Fetch) -> Collected:
    """Return all documents of a description.

    Raises:
        ValueError: the first one is not a WSDL; the message says why.
    """
    try:
        # WSDL 1.1 forbids no DOCTYPE: that one is there blames nobody, and nothing of it is read.
        root = parse(wsdl, doctype=True)
    except NotXmlError as error:
        raise ValueError(str(error)) from error
    if root.tag != clark(WSDL, "definitions"):
        raise ValueError(f"the root element {root.tag} instead of wsdl:definitions")
    found = Collected()
    waiting: list[tuple[str, etree._Element]] = [(location, root)]
    seen = {location}
    while waiting:
        place, element = waiting.pop(0)
        for reference in _take(found, place, element):
            target = _resolved(place, reference)
            if target in seen:
                continue
            seen.add(target)
            if len(seen) > _MOST:
                found.missing[target] = f"more than {_MOST} documents"
                return found
            try:
                waiting.append((target, parse(fetch(target), doctype=True)))
            except (OSError, ValueError) as error:
                found.missing[target] = str(error) or type(error).__name__
    return found


def _take(found: Collected, place: str, root: etree._Element) -> list[str]:
    """Add a document, and return the locations that it refers to."""
    if root.tag == clark(WSDL, "definitions"):
        found.definitions.append(root)
        references = [element.get("location") for element in root.findall(clark(WSDL, "import"))]
        for number, schema in enumerate(root.iterfind(f"{clark(WSDL, 'types')}/{clark(XSD, 'schema')}")):
            found.schemas.append(SchemaDocument(f"{place}#{number}", schema, inline=True))
            references += _schema_references(schema)
    elif root.tag == clark(XSD, "schema"):
        found.schemas.append(SchemaDocument(place, root))
        references = _schema_references(root)
    else:
        found.missing[place] = f"neither a WSDL nor a schema, but {root.tag}"
        references = []
    return [reference for reference in references if reference]


def _schema_references(root: etree._Element) -> list[str | None]:
    return [
        element.get("schemaLocation")
        for kind in ("import", "include", "redefine")
        for element in root.findall(clark(XSD, kind))
    ]


def _resolved(place: str, reference: str) -> str:
    if "://" in reference or "://" in place:
        return urljoin(place, reference)
    return str(Path(place).parent / reference)
