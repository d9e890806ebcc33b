"""Robots whose WSDL is not the contract's, or breaks WS-I Basic Profile 1.1."""

import re
from collections.abc import Callable
from typing import Any

from lxml import etree

from conformance.mutation.changes import Make, altered, hanging_up, instead, plain, text, wsdls
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import TNS
from conformance.packs.table1.mutants.soap_responses import latin
from conformance.packs.table1.mutants.xml_trees import gone, named, tree

_WSDL = "http://schemas.xmlsoap.org/wsdl/"
_XSD = "http://www.w3.org/2001/XMLSchema"
_SOAP = "http://schemas.xmlsoap.org/wsdl/soap/"
_W, _S, _X = f"{{{_WSDL}}}", f"{{{_SOAP}}}", f"{{{_XSD}}}"


def _description(request: Request) -> bool:
    return wsdls(request) and request.query.lower() == "wsdl"


def _edited(edit: Callable[[Any], object]) -> Make:
    """Alter the WSDL; ``edit`` gets its root."""
    return altered(_description, tree(edit))


def _typed(edit: Callable[[Any], object]) -> Make:
    """Alter schemas, inline or in documents of their own; ``edit`` gets each schema that declares something."""

    def apply(root: Any) -> None:
        for schema in root.iter(f"{_X}schema"):
            if len(schema) and schema.find(f"{_X}import") is None:
                edit(schema)

    return altered(wsdls, tree(apply))


def _all(path: str, edit: Callable[[Any], object], which: slice = slice(None)) -> Make:
    """Alter the WSDL's elements at a path, or some of them."""

    def apply(root: Any) -> None:
        for node in root.findall(path)[which]:
            edit(node)

    return _edited(apply)


def _first(path: str, edit: Callable[[Any], object]) -> Make:
    return _all(path, edit, slice(1))


def _set(name: str, value: str) -> Callable[[Any], None]:
    return lambda node: node.set(name, value)


def _twice(node: Any) -> None:
    node.addnext(etree.fromstring(etree.tostring(node)))


def _broken_import(request: Request, forward: Forward) -> Response:
    """The documents that the WSDL refers to are not there."""
    response = forward(request)
    if _description(request):
        imported = f'<x:schema xmlns:x="{_XSD}"><x:import namespace="{TNS}" schemaLocation="gone.xsd"/></x:schema>'
        body = re.sub(rb"<([\w]+:)?schema\b.*</([\w]+:)?schema>", imported.encode(), response.body, flags=re.DOTALL)
        response.body = body
    elif wsdls(request) or request.path.endswith("gone.xsd"):
        return plain(404, b"gone", "text/plain")(request)
    return response


def _operation_lost(root: Any) -> None:
    for node in (root.find(_OPERATION), root.find(f"{_BINDING}/{_W}operation")):
        gone(node)


def _typed_part(node: Any) -> None:
    node.attrib.pop("element", None)
    node.set("type", f"{_prefix(node)}:deliveryRequestMessage")


def _prefix(node: Any) -> str:
    return next((key for key, value in node.nsmap.items() if key and "soap.turtlebot" in value), "tns")


def _import_in_types(root: Any) -> None:
    types = root.find(f"{_W}types")
    made = etree.Element(f"{_X}import")
    made.set("namespace", TNS)
    types.insert(0, made)


def _strange(root: Any) -> None:
    etree.SubElement(root, f"{_W}robot").set("name", "turtlebot")


def _same_element(root: Any) -> None:
    parts = [part for part in root.iter(f"{_W}part") if not part.get("element", "").endswith("Response")]
    if len(parts) > 1:
        parts[1].set("element", parts[0].get("element"))


def _two_parts(root: Any) -> None:
    for message in root.findall(f"{_W}message")[:1]:
        second = etree.SubElement(message, f"{_W}part")
        second.set("name", "more")
        second.set("element", message[0].get("element"))
    for body in list(root.iter(f"{_S}body"))[:1]:
        body.set("parts", "parameters more")


def _float(schema: Any) -> None:
    for node in [node for node in schema.iter(f"{_X}element") if node.get("type", "").endswith("double")][:1]:
        node.set("type", node.get("type").replace("double", "float"))


def _long_sequence(edit: Callable[[Any], object]) -> Make:
    """Alter the first sequence of each schema that has more than two elements."""

    def apply(schema: Any) -> None:
        for sequence in [one for one in schema.iter(f"{_X}sequence") if len(one) > 2][:1]:
            edit(sequence)

    return _typed(apply)


def _inline_no_target(root: Any) -> None:
    """A schema of its own in wsdl:types, which declares an element in no namespace at all."""
    for schema in named(root, "schema")[:1]:
        made = etree.Element(f"{_X}schema")
        etree.SubElement(made, f"{_X}element").set("name", "homeless")
        schema.addnext(made)


_mutant = of_class("describe", "soap")

_OPERATION = f"{_W}portType/{_W}operation"
_BINDING = f"{_W}binding"
_TRANSPORT = f"{_BINDING}/{_S}binding"

MUTANTS = (
    _mutant("wsdl-gone", "There is no WSDL: 404.", "wsdl", instead(wsdls, plain(404))),
    _mutant("wsdl-silent", "Asked for its WSDL, the robot hangs up.", "wsdl", hanging_up(wsdls)),
    _mutant("wsdl-broken", "The WSDL is not closed.", "wsdl", altered(_description, text(r"</[\w:]+>\s*$", ""))),
    _mutant("wsdl-import-gone", "What the WSDL imports is not there.", "wsdl", lambda: _broken_import),
    _mutant(
        "wsdl-service-name",
        "The service has another name.",
        "wsdl-names",
        _all(f"{_W}service", _set("name", "TurtlebotOfficeService")),
    ),
    _mutant(
        "wsdl-port-name",
        "The port has another name.",
        "wsdl-names",
        _all(f"{_W}service/{_W}port", _set("name", "Port")),
    ),
    _mutant(
        "wsdl-namespace",
        "The target namespace is the second listing's.",
        "wsdl-names",
        _edited(_set("targetNamespace", "http://ros-ws.org")),
    ),
    _mutant("wsdl-operation-lost", "The WSDL lacks an operation.", "wsdl-operations", _edited(_operation_lost)),
    _mutant(
        "wsdl-part-name",
        "A message's part has another name.",
        "wsdl-operations",
        _all(f"{_W}message/{_W}part", _set("name", "body")),
    ),
    _mutant("wsdl-float", "A double is a float in the schema.", "wsdl-types", _typed(_float)),
    _mutant(
        "wsdl-order",
        "The schema has its elements in another order.",
        "wsdl-types",
        _long_sequence(lambda sequence: sequence.append(sequence[0])),
    ),
    _mutant(
        "wsdl-optional",
        "An element is optional in the schema.",
        "wsdl-types",
        _long_sequence(lambda sequence: sequence[0].set("minOccurs", "0")),
    ),
    _mutant(
        "wsdl-action",
        "wsam:Action is something else.",
        "wsdl-action",
        altered(_description, text(r'(:Action=["\'])[^"\']*', r"\1urn:drive")),
    ),
    _mutant(
        "wsdl-address",
        "The address in the WSDL leads nowhere.",
        "wsdl-address",
        altered(_description, text(r'location="http://[^"]*"', 'location="http://127.0.0.1:9/turtlesim"')),
    ),
    _mutant("wsdl-import-in-types", "xsd:import stands in wsdl:types itself.", "wsdl-R2003", _edited(_import_in_types)),
    _mutant(
        "wsdl-strange-element", "The WSDL has an element that WSDL does not know.", "wsdl-R2028", _edited(_strange)
    ),
    _mutant(
        "wsdl-no-target",
        "A schema has no targetNamespace.",
        "wsdl-R2105",
        altered(_description, tree(_inline_no_target)),
    ),
    _mutant("wsdl-two-parts", "A body names two parts.", "wsdl-R2201", _edited(_two_parts)),
    _mutant(
        "wsdl-type-part",
        "A part has a type in place of an element.",
        "wsdl-R2204",
        _first(f"{_W}message/{_W}part", _typed_part),
    ),
    _mutant(
        "wsdl-part-of-nothing",
        "A part refers to an element that does not exist.",
        "wsdl-R2206",
        _first(f"{_W}message/{_W}part", lambda node: node.set("element", f"{_prefix(node)}:NothingAtAll")),
    ),
    _mutant("wsdl-operation-twice", "A port type has an operation twice.", "wsdl-R2304", _first(_OPERATION, _twice)),
    _mutant(
        "wsdl-soap12",
        "The binding is one of SOAP 1.2.",
        "wsdl-R2401",
        altered(_description, text(re.escape(_SOAP), "http://schemas.xmlsoap.org/wsdl/soap12/")),
    ),
    _mutant(
        "wsdl-no-transport",
        "The binding names no transport.",
        "wsdl-R2701",
        _all(_TRANSPORT, lambda node: node.attrib.pop("transport", None)),
    ),
    _mutant(
        "wsdl-smtp",
        "The transport is SMTP.",
        "wsdl-R2702",
        _all(_TRANSPORT, _set("transport", "http://schemas.xmlsoap.org/soap/smtp")),
    ),
    _mutant(
        "wsdl-mixed-styles",
        "One operation is of style rpc.",
        "wsdl-R2705",
        _first(f"{_BINDING}/{_W}operation/{_S}operation", _set("style", "rpc")),
    ),
    _mutant(
        "wsdl-encoded",
        "A body is encoded.",
        "wsdl-R2706",
        _first(f"{_BINDING}/{_W}operation/{_W}input/{_S}body", _set("use", "encoded")),
    ),
    _mutant("wsdl-same-signature", "Two operations have the same element.", "wsdl-R2710", _edited(_same_element)),
    _mutant(
        "wsdl-body-namespace",
        "A body has a namespace attribute.",
        "wsdl-R2716",
        _first(f"{_BINDING}/{_W}operation/{_W}input/{_S}body", _set("namespace", TNS)),
    ),
    _mutant(
        "wsdl-binding-short",
        "The binding lacks an operation of its port type.",
        "wsdl-R2718",
        _first(f"{_BINDING}/{_W}operation", gone),
    ),
    _mutant(
        "wsdl-old-schema",
        "Types are described in XML Schema of 1999.",
        "wsdl-R2801",
        altered(wsdls, text(re.escape(_XSD), "http://www.w3.org/1999/XMLSchema")),
    ),
    _mutant("wsdl-latin", "The WSDL is ISO 8859-1.", "wsdl-R4003", altered(_description, latin)),
)
