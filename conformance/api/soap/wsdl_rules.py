"""Rules of the Basic Profile 1.1 for descriptions: each function yields violations of the rule in its name."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Final

from lxml import etree

from conformance.documents.wsdl import Wsdl, name, qname
from conformance.documents.xml import WSDL, WSDL_SOAP, XSD, clark, elements, local, namespace
from conformance.documents.xsd import SchemaError

_HTTP: Final = "http://schemas.xmlsoap.org/soap/http"
_ENCODINGS: Final = frozenset({"UTF-8", "UTF-16", "UTF-16LE", "UTF-16BE", "US-ASCII", "ASCII"})
# WSDL 1.1, 2.1 and its schema: which elements of its namespace an element may hold, and which attributes it must have.
_CHILDREN: Final[dict[str, frozenset[str]]] = {
    "definitions": frozenset({"documentation", "import", "types", "message", "portType", "binding", "service"}),
    "import": frozenset({"documentation"}),
    "types": frozenset({"documentation"}),
    "message": frozenset({"documentation", "part"}),
    "part": frozenset({"documentation"}),
    "portType": frozenset({"documentation", "operation"}),
    "operation": frozenset({"documentation", "input", "output", "fault"}),
    "input": frozenset({"documentation"}),
    "output": frozenset({"documentation"}),
    "fault": frozenset({"documentation"}),
    "binding": frozenset({"documentation", "operation"}),
    "service": frozenset({"documentation", "port"}),
    "port": frozenset({"documentation"}),
}
_ATTRIBUTES: Final[dict[str, tuple[str, ...]]] = {
    "import": ("namespace", "location"),
    "message": ("name",),
    "part": ("name",),
    "portType": ("name",),
    "operation": ("name",),
    "binding": ("name", "type"),
    "service": ("name",),
    "port": ("name", "binding"),
}
# R2022, R2023: imports before everything else, then types.
_ORDER: Final = {"import": 0, "types": 1}


def r2003(description: Wsdl) -> Iterator[str]:
    """Types with XML Schema, and xsd:import only inside xsd:schema."""
    if not description.schemas:
        yield "no xsd:schema in wsdl:types"
    for element in description.all(".//*"):
        parent = element.getparent()
        if element.tag == clark(XSD, "import") and parent is not None and parent.tag != clark(XSD, "schema"):
            yield f"an xsd:import in {parent.tag}"


def r2028(description: Wsdl) -> Iterator[str]:
    """The structure that the schema of WSDL 1.1 and R2022, R2023 allow."""
    for root in description.definitions:
        ranks = [_ORDER.get(local(str(child.tag)), 2) for child in elements(root) if _is_part(child)]
        if ranks != sorted(ranks):
            yield "an order other than wsdl:import, wsdl:types and then the rest"
        for element in root.iter():
            if isinstance(element.tag, str) and namespace(element.tag) == WSDL:
                yield from _structure(element)


def _is_part(child: etree._Element) -> bool:
    return namespace(str(child.tag)) == WSDL and local(str(child.tag)) != "documentation"


def _structure(element: etree._Element) -> Iterator[str]:
    kind = local(str(element.tag))
    if kind == "documentation":
        return
    if kind not in _CHILDREN:
        yield f"a wsdl:{kind}, which WSDL 1.1 does not have"
        return
    for attribute in _ATTRIBUTES.get(kind, ()):
        if not element.get(attribute):
            yield f"wsdl:{kind} without {attribute}"
    for child in elements(element):
        if namespace(str(child.tag)) == WSDL and local(str(child.tag)) not in _CHILDREN[kind]:
            yield f"wsdl:{local(str(child.tag))} in wsdl:{kind}"


def r2105(description: Wsdl) -> Iterator[str]:
    """A targetNamespace on every schema that declares something."""
    for document in description.schemas:
        if document.inline and not document.namespace:
            declared = [
                str(child.tag)
                for child in elements(document.root)
                if child.tag not in {clark(XSD, "import"), clark(XSD, "annotation")}
            ]
            if declared:
                yield f"a schema without targetNamespace that has {local(declared[0])}"


def _bodies(description: Wsdl) -> Iterator[tuple[etree._Element, str, etree._Element]]:
    """Each soap:body of the SOAP bindings, with its operation's name and its message."""
    signatures = {
        name(operation): operation
        for port_type in description.all("w:portType")
        for operation in port_type.findall(clark(WSDL, "operation"))
    }
    for operation in description.all("w:binding[s:binding]/w:operation"):
        declared = signatures.get(name(operation))
        for side in ("input", "output"):
            for body in operation.findall(f"{clark(WSDL, side)}/{clark(WSDL_SOAP, 'body')}"):
                part = declared.find(clark(WSDL, side)) if declared is not None else None
                message = description.find("w:message", part, "message") if part is not None else None
                if message is not None:
                    yield body, name(operation), message


def r2201(description: Wsdl) -> Iterator[str]:
    """At most one part in each soap:body (with R2210: in its message, where it names none)."""
    for body, operation, message in _bodies(description):
        named = body.get("parts")
        count = len(named.split()) if named is not None else len(message.findall(clark(WSDL, "part")))
        if count > 1:
            yield f"{count} parts in one soap:body of {operation}"


def r2204(description: Wsdl) -> Iterator[str]:
    """Parts by element."""
    for _, operation, message in _bodies(description):
        for part in message.findall(clark(WSDL, "part")):
            if not part.get("element"):
                yield f"part {name(part)!r} of {name(message)} without element, for {operation}"


def r2206(description: Wsdl) -> Iterator[str]:
    """A type or an element, which is a global one that exists."""
    for part in description.all("w:message/w:part"):
        if bool(part.get("element")) == bool(part.get("type")):
            yield f"part {name(part)!r} with {'both' if part.get('type') else 'neither'} type and element"
        elif part.get("element"):
            tag = qname(part, part.get("element"))
            try:
                if tag is None or description.shape(tag) is None:
                    yield f"part {name(part)!r} with the element {part.get('element')!r}, which no schema has"
            except SchemaError as error:
                yield f"schemas that do not compile: {error}"
                return


def r2304(description: Wsdl) -> Iterator[str]:
    """Operations of different names."""
    for port_type in description.all("w:portType"):
        counted = Counter(name(operation) for operation in port_type.findall(clark(WSDL, "operation")))
        yield from (
            f"{count} operations of the name {operation!r}" for operation, count in counted.items() if count > 1
        )


def r2401(description: Wsdl) -> Iterator[str]:
    """A soap:binding of WSDL 1.1."""
    if not description.all("w:binding[s:binding]"):
        yield "no wsdl:binding with a soap:binding"


def r2701(description: Wsdl) -> Iterator[str]:
    """A transport."""
    for binding in description.all("w:binding/s:binding"):
        if not binding.get("transport"):
            yield "soap:binding without transport"


def r2702(description: Wsdl) -> Iterator[str]:
    """SOAP over HTTP."""
    for binding in description.all("w:binding/s:binding"):
        if binding.get("transport") != _HTTP:
            yield f"transport {binding.get('transport')!r}"


def r2705(description: Wsdl) -> Iterator[str]:
    """Yield bindings with another style than document, the default."""
    for binding in description.all("w:binding[s:binding]"):
        default = binding.find(clark(WSDL_SOAP, "binding"))
        style = (default.get("style") if default is not None else None) or "document"
        styles = {
            operation.get("style") or style
            for operation in binding.findall(f"{clark(WSDL, 'operation')}/{clark(WSDL_SOAP, 'operation')}")
        } | {style}
        if styles != {"document"}:
            yield f"style {' and '.join(sorted(styles))}"


def r2706(description: Wsdl) -> Iterator[str]:
    """Yield bodies with another use than literal, the default (R2707)."""
    for kind in ("body", "header", "headerfault", "fault"):
        for element in description.all(f"w:binding//s:{kind}"):
            if element.get("use", "literal") != "literal":
                yield f"soap:{kind} with use {element.get('use')!r}"


def r2710(description: Wsdl) -> Iterator[str]:
    """Different elements in the Body for different operations."""
    counted = Counter(operation.request for operation in description.operations)
    yield from (
        f"{count} operations with the same request element {tag}" for tag, count in counted.items() if count > 1
    )


def r2716(description: Wsdl) -> Iterator[str]:
    """No namespace attribute on soap:body and its like."""
    for kind in ("body", "header", "headerfault", "fault"):
        for element in description.all(f"w:binding//s:{kind}"):
            if element.get("namespace") is not None:
                yield f"soap:{kind} with namespace {element.get('namespace')!r}"


def r2718(description: Wsdl) -> Iterator[str]:
    """The operations of the port type, each once."""
    port_types = {name(element): element for element in description.all("w:portType")}
    for binding in description.all("w:binding[s:binding]"):
        port_type = port_types.get((binding.get("type") or "").rpartition(":")[2])
        wanted = (
            Counter(name(item) for item in port_type.findall(clark(WSDL, "operation"))) if port_type is not None else {}
        )
        bound = Counter(name(item) for item in binding.findall(clark(WSDL, "operation")))
        if wanted != bound:
            yield f"{name(binding)} with {', '.join(sorted(bound)) or 'nothing'}, not {', '.join(sorted(wanted))}"


def r2801(description: Wsdl) -> Iterator[str]:
    """XML Schema 1.0."""
    for types in description.all("w:types"):
        for child in elements(types):
            if child.tag not in {clark(XSD, "schema"), clark(WSDL, "documentation")}:
                yield f"{child.tag} in wsdl:types"
    try:
        _ = description.types
    except SchemaError as error:
        yield f"schemas that do not compile: {error}"


def r4003(description: Wsdl) -> Iterator[str]:
    """UTF-8 or UTF-16, all documents."""
    for root in [*description.definitions, *(document.root for document in description.schemas)]:
        encoding = (root.getroottree().docinfo.encoding or "UTF-8").upper()
        if encoding not in _ENCODINGS:
            yield f"encoding {encoding!r}"


RULES: Final[dict[str, Callable[[Wsdl], Iterator[str]]]] = {
    "R2003": r2003,
    "R2028": r2028,
    "R2105": r2105,
    "R2201": r2201,
    "R2204": r2204,
    "R2206": r2206,
    "R2304": r2304,
    "R2401": r2401,
    "R2701": r2701,
    "R2702": r2702,
    "R2705": r2705,
    "R2706": r2706,
    "R2710": r2710,
    "R2716": r2716,
    "R2718": r2718,
    "R2801": r2801,
    "R4003": r4003,
}
