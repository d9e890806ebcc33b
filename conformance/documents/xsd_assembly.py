"""Write schema documents into a folder in a form that libxml2 and xmlschema compile.

libxml2 loads one document per imported namespace, so each namespace gets one that includes all its documents.
What schemas refer to and no document declares allows anything, and is marked, so that no message is made of it.
"""

from __future__ import annotations

import os.path
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

from lxml import etree

from conformance.documents.xml import XSD, clark, local, namespace
from conformance.transport.reach import joined

_IMPORT, _INCLUDE = clark(XSD, "import"), clark(XSD, "include")
_REDEFINE: Final = (clark(XSD, "redefine"), clark(XSD, "override"))
_SCHEMA: Final = clark(XSD, "schema")
# The kind of component that each attribute names; a type may be simple or complex.
_NAMED: Final = {
    "type": "type",
    "base": "type",
    "itemType": "type",
    "memberTypes": "type",
    "substitutionGroup": "element",
}
_XML: Final = "http://www.w3.org/XML/1998/namespace"
# Counts of occurrences beyond this would exhaust libxml2's memory.
_MANY: Final = 1000


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

    def targets(self, *tags: str) -> Iterator[str]:
        """Yield the locations that its references of some kinds name."""
        for reference in self.root.iterchildren(*tags):
            if reference.get("schemaLocation"):
                yield location_of(self.location, reference.get("schemaLocation", ""))


@dataclass
class Assembly:
    """The written documents.

    Attributes:
        entry: the document that imports all others.
        unknown: components that are referred to, and that no document declares.
        twice: components that several documents declare, each in its own way; the first one counts.
    """

    entry: Path
    unknown: list[Component] = field(default_factory=list)
    twice: list[Component] = field(default_factory=list)


def location_of(place: str, reference: str) -> str:
    """Return a reference in a document as a location, without "." and ".."."""
    if "://" in reference or "://" in place:
        return joined(place, reference)
    return os.path.normpath(Path(place).parent / reference)


def assemble(documents: Sequence[SchemaDocument], folder: Path) -> Assembly:
    """Write documents into a folder, with an entry document that imports them all."""
    made = Assembly(folder / "entry.xsd")
    documents = [one for one in documents if not _only_imports(one)]
    spaces, inner = _spaces(documents), _redefined_ones(documents)
    # Write and parse the inline schema again: a copy would lose the prefixes that the WSDL around it declares.
    roots = [etree.fromstring(etree.tostring(one.root, with_tail=False)) for one in documents]
    names = {one.location: f"document{number}.xsd" for number, one in enumerate(documents)}
    members: dict[str, list[str]] = {space: [] for one in documents for space in sorted(spaces[one.location])}
    known: dict[Component, bytes] = {}
    for document, root in zip(documents, roots, strict=True):
        outer = document.location not in inner
        for space in sorted(spaces[document.location]):
            if outer:
                members[space].append(names[document.location])
            made.twice += _declare(known, root, space, drop=outer and len(spaces[document.location]) == 1)
    for document, root in zip(documents, roots, strict=True):
        for space in spaces[document.location]:
            made.unknown += (
                component
                for component in references(root, space)
                if component not in known and component not in made.unknown
            )
    for root in roots:
        _import(root, {component.space for component in made.unknown})
    spaces_of = [one.namespace for one in documents]
    allow_anything(spaces_of, roots, {component.tag for component in made.unknown if component.kind == "type"})
    for space in dict.fromkeys(component.space for component in made.unknown):
        name = f"unknown{len(names)}.xsd"
        names[name] = name
        (folder / name).write_bytes(
            stand_ins(space, [component for component in made.unknown if component.space == space], roots)
        )
        members.setdefault(space, []).append(name)
    collected = {space: f"namespace{number}.xsd" for number, space in enumerate(sorted(members))}
    for document, root in zip(documents, roots, strict=True):
        _relocate(document, root, collected, names, keep=document.location in inner)
        (folder / names[document.location]).write_bytes(etree.tostring(root))
    made.unknown = [component for component in made.unknown if component.space != _XML]
    for space, place in collected.items():
        (folder / place).write_bytes(_schema_of(space, includes=members[space]))
    imports = {space: place for space, place in collected.items() if space}
    made.entry.write_bytes(_schema_of("", includes=members.get("", []), imports=imports))
    return made


def _spaces(documents: Sequence[SchemaDocument]) -> dict[str, set[str]]:
    """Return the namespaces of each document: one without a namespace takes those of the documents that include it."""
    found = {one.location: {one.namespace} if one.namespace or one.inline else set() for one in documents}
    changed = True
    while changed:
        changed = False
        for document in documents:
            for target in document.targets(_INCLUDE, *_REDEFINE):
                new = found[document.location] - found.get(target, set())
                if new and any(one.location == target and not one.namespace for one in documents):
                    found[target] |= new
                    changed = True
    imported = {
        location_of(one.location, reference.get("schemaLocation", ""))
        for one in documents
        for reference in one.root.iterchildren(_IMPORT)
        if not reference.get("namespace") and reference.get("schemaLocation")
    }
    for place, spaces in found.items():
        if not spaces or place in imported:
            spaces.add(next(one.namespace for one in documents if one.location == place))
    return found


def _redefined_ones(documents: Sequence[SchemaDocument]) -> set[str]:
    """Return the documents that others redefine, with those they include: no other document may include them."""
    by_place = {document.location: document for document in documents}
    waiting = [target for document in documents for target in document.targets(*_REDEFINE)]
    found: set[str] = set()
    while waiting:
        place = waiting.pop()
        if place in by_place and place not in found:
            found.add(place)
            waiting += by_place[place].targets(_INCLUDE, *_REDEFINE)
    return found


def _declare(known: dict[Component, bytes], root: etree._Element, space: str, *, drop: bool) -> list[Component]:
    """Add a document's components, skip equal ones that exist, and return those that differ."""
    differ: list[Component] = []
    parents = [root, *root.iterchildren(*_REDEFINE)]
    for child in [
        element for parent in parents for element in parent.iterchildren(etree.Element) if element.get("name")
    ]:
        component = Component(kind_of(child.tag), space, child.get("name", ""))
        text = etree.tostring(child, method="c14n", exclusive=True)
        if child.getparent() is root and component in known and drop:
            differ += [component] if known[component] != text else []
            root.remove(child)
        known.setdefault(component, text)
    return differ


def kind_of(tag: str) -> str:
    """Return the kind of component that an element with a tag declares or refers to."""
    name = etree.QName(tag).localname
    return "type" if name in {"complexType", "simpleType"} else name


def references(root: etree._Element, space: str, *, deep: bool = True) -> Iterator[Component]:
    """Yield the components that a document or a part refers to; without ``deep``, only the part's own references."""
    for element in root.iter(etree.Element) if deep else (root,):
        for attribute, text in element.attrib.items():
            kind = kind_of(element.tag) if attribute == "ref" else _NAMED.get(str(attribute))
            for name in str(text).split() if kind and etree.QName(element).namespace == XSD else ():
                prefix, _, local = name.rpartition(":")
                given = element.nsmap.get(prefix or None) or ("" if root.get("targetNamespace") else space)
                given = _XML if prefix == "xml" else given
                if given != XSD and (not prefix or prefix in {"xml", *element.nsmap}):
                    yield Component(str(kind), given, local)


def _import(root: etree._Element, spaces: set[str]) -> None:
    """Let a document import those of some namespaces that it refers to."""
    own = root.get("targetNamespace") or ""
    there = {reference.get("namespace") or "" for reference in root.iterchildren(_IMPORT)}
    for space in sorted(({component.space for component in references(root, own)} & spaces) - there - {own}):
        root.insert(0, etree.Element(_IMPORT, {"namespace": space} if space else {}))


def _relocate(
    document: SchemaDocument,
    root: etree._Element,
    collected: Mapping[str, str],
    names: Mapping[str, str],
    *,
    keep: bool,
) -> None:
    """Let a document's references name the written files; without includes, unless they are kept."""
    for reference in [*root.iterchildren(_IMPORT, _INCLUDE, *_REDEFINE)]:
        place = location_of(document.location, reference.get("schemaLocation", ""))
        if reference.tag == _IMPORT:
            reference.attrib.pop("schemaLocation", "")
            if name := collected.get(reference.get("namespace") or ""):
                reference.set("schemaLocation", name)
        elif place in names and (reference.tag != _INCLUDE or keep):
            reference.set("schemaLocation", names[place])
        else:
            root.remove(reference)
    for element in root.iter(clark(XSD, "element"), clark(XSD, "any"), clark(XSD, "sequence"), clark(XSD, "choice")):
        if (most := element.get("maxOccurs", "")).isdigit() and int(most[:9]) > _MANY:
            element.set("maxOccurs", "unbounded")


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


def rpc_wrapper(name: str, space: str, parts: Sequence[tuple[str, str]]) -> SchemaDocument:
    """Return a schema with the wrapper of an rpc message (WSDL 1.1, 3.5): its parts by name and type."""
    # Declared once: xmlschema does not read a prefix that another element declares again for another namespace.
    spaces = dict.fromkeys(namespace(type_) for _, type_ in parts if namespace(type_) not in {"", XSD})
    prefixes = {XSD: "xs", **{other: f"t{place}" for place, other in enumerate(spaces)}}
    nsmap = {prefix: other for other, prefix in prefixes.items()}
    root = etree.Element(_SCHEMA, {"targetNamespace": space} if space else {}, nsmap=nsmap)
    for other in spaces:
        if other != space:
            etree.SubElement(root, _IMPORT, namespace=other)
    # No schema declares a wrapper, so one without parts may have xsi:nil, as that of SOAP::Lite has.
    own = {"name": name} if parts else {"name": name, "nillable": "true"}
    whole = etree.SubElement(etree.SubElement(root, clark(XSD, "element"), own), clark(XSD, "complexType"))
    inside = etree.SubElement(whole, clark(XSD, "sequence"))
    for part, type_ in parts:
        written = f"{prefixes[namespace(type_)]}:{local(type_)}" if namespace(type_) else local(type_)
        etree.SubElement(inside, clark(XSD, "element"), {"name": part, "type": written})
    return SchemaDocument(f"rpc:{name}", root, inline=True)


#: Stands for a type that no document declares.
UNKNOWN = "{urn:example:roaas}unknown"
#: Stands for a type whose pattern may take Python too long.
LEFT_OUT = "{urn:example:roaas}pattern"
_COMPLEX, _SIMPLE = clark(XSD, "complexType"), clark(XSD, "simpleType")


class Component(NamedTuple):
    """A global component of a schema: its kind (element, type, attribute, group, attributeGroup), and its name."""

    kind: str
    space: str
    name: str

    @property
    def tag(self) -> str:
        """Return its name in Clark notation."""
        return clark(self.space, self.name)


def allow_anything(spaces: Sequence[str], roots: Sequence[etree._Element], unknown: set[str]) -> None:
    """Let complex types derived from unknown ones allow anything, because their base is not known.

    Args:
        spaces: the target namespace of each document.
        roots: the documents.
        unknown: names of unknown types, to which those that are derived from them are added.
    """
    waiting = True
    while waiting:
        waiting = False
        for space, root in zip(spaces, roots, strict=True):
            for derived in root.iterfind(f".//{clark(XSD, 'complexContent')}/*[@base]"):
                whole = next(derived.iterancestors(_COMPLEX), None)
                prefix, _, local = derived.get("base", "").rpartition(":")
                if whole is not None and clark(derived.nsmap.get(prefix or None), local) in unknown:
                    _make_any(whole)
                    if whole.get("name"):
                        unknown.add(clark(space, whole.get("name", "")))
                    waiting = True
    for root in roots:
        # An element without a type may contain anything; its xsi:type may name the type.
        for element in root.iterfind(f".//{clark(XSD, 'element')}[@type]"):
            prefix, _, local = element.get("type", "").rpartition(":")
            if clark(element.nsmap.get(prefix or None), local) in unknown and "substitutionGroup" not in element.attrib:
                del element.attrib["type"]
                element.set(UNKNOWN, "true")


def _make_any(whole: etree._Element) -> None:
    """Let a complex type allow anything."""
    for child in list(whole):
        whole.remove(child)
    whole.set("mixed", "true")
    whole.set(UNKNOWN, "true")
    content = etree.SubElement(whole, clark(XSD, "sequence"))
    etree.SubElement(content, clark(XSD, "any"), minOccurs="0", maxOccurs="unbounded", processContents="skip")
    etree.SubElement(whole, clark(XSD, "anyAttribute"), processContents="skip")


def stand_ins(space: str, components: Sequence[Component], roots: Sequence[etree._Element]) -> bytes:
    """Return a schema of components that allow anything."""
    simple = {name for root in roots for name in _simple_types(root)}
    root = etree.Element(_SCHEMA, {"targetNamespace": space} if space else {}, nsmap={"xs": XSD})
    for component in components:
        if component.kind == "attribute":
            etree.SubElement(root, clark(XSD, "attribute"), name=component.name, type="xs:string")
        elif component.kind == "type" and component.tag in simple:
            kind = etree.SubElement(root, _SIMPLE, {"name": component.name, UNKNOWN: "true"})
            etree.SubElement(kind, clark(XSD, "restriction"), base="xs:string")
        elif component.kind == "type":
            _make_any(etree.SubElement(root, _COMPLEX, name=component.name))
        elif component.kind == "element":
            _make_any(etree.SubElement(etree.SubElement(root, clark(XSD, "element"), name=component.name), _COMPLEX))
        else:
            group = etree.SubElement(root, clark(XSD, component.kind), name=component.name)
            _make_any(group)
            for key in (UNKNOWN, "mixed"):
                del group.attrib[key]
            unwanted = "sequence" if component.kind == "attributeGroup" else "anyAttribute"
            group.remove(next(group.iterchildren(clark(XSD, unwanted))))
    return etree.tostring(root)


def _simple_types(root: etree._Element) -> Iterator[str]:
    """Yield the names of types that can only be simple: of attributes, of lists, and of simple content."""
    for element in root.iter(etree.Element):
        parent, name = element.getparent(), etree.QName(element).localname
        within = etree.QName(parent).localname if parent is not None else ""
        texts = [element.get("type")] if name == "attribute" else []
        texts += [element.get("itemType"), element.get("memberTypes")]
        texts += [element.get("base")] if within in {"simpleType", "simpleContent"} else []
        for text in " ".join(filter(None, texts)).split():
            prefix, _, local = text.rpartition(":")
            yield clark(element.nsmap.get(prefix or None), local)
