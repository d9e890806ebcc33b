"""What schemas refer to and no document declares: it allows anything, and is marked, so no message is made of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from lxml import etree

from conformance.documents.xml_names import XSD, clark

#: Marks a type that is not known, because no document declares it.
UNKNOWN: Final = "{urn:example:roaas}unknown"
_COMPLEX, _SIMPLE, _SCHEMA = clark(XSD, "complexType"), clark(XSD, "simpleType"), clark(XSD, "schema")


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
    """Let the complex types that are derived from unknown ones allow anything: what they add to is not known.

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
        # An element without a type holds anything, and an xsi:type may say what.
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
