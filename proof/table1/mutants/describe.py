"""Mutants whose descriptions are wrong: OpenAPI, WADL, WSDL."""

import re
from collections.abc import Callable, Iterator
from copy import deepcopy
from typing import Any

from lxml import etree

from proof.mutation.changes import Make, altered, plain, rest, wsdls
from proof.mutation.fields import each as both
from proof.mutation.fields import field, without
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.mutation.xml_trees import each, find_named, remove, tree
from proof.table1.mutants.paths import PLAN, TNS

MUTANTS = Table()
_mutant = MUTANTS.of_class("describe", "rest")

_OPENAPI, _WADL = rest("GET", "/openapi.json"), rest("GET", "/application.wadl")


def _lose(name: str, attribute: str, pattern: str) -> Make:
    """Return a change that removes the WADL's elements ``name`` whose attribute matches the pattern."""

    def edit(node: Any) -> None:
        if re.search(pattern, node.get(attribute, "")):
            remove(node)

    return altered(_WADL, tree(each(name, edit)))


def _promised_twice(resource: Any) -> None:
    """Add a copy of a WADL resource with a path that does not exist."""
    other = deepcopy(resource)
    other.set("path", "/robot/arm/")
    resource.getparent().append(other)


def _with_default(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema whose default, where it has a numeric one, is another."""
    return {**schema, "default": schema["default"] + 0.4} if isinstance(schema.get("default"), float) else schema


def _objects(node: Any) -> Iterator[dict[str, Any]]:
    """Yield each JSON object in a document."""
    if isinstance(node, dict):
        yield node
    for part in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from _objects(part)


def _rename(told: Any, old: str, new: str) -> None:
    """Give a member another name in all schemas."""
    for node in list(_objects(told)):
        if isinstance(node.get("properties"), dict) and old in node["properties"]:
            node["properties"][new] = node["properties"].pop(old)
            node["required"] = [new if name == old else name for name in node.get("required", ())]


_mutant("openapi-without-parameter", "openapi-operations", "/openapi.json lacks a parameter.").json(
    _OPENAPI, field(f"paths.{PLAN}.get.parameters", lambda all_: [item for item in all_ if item.get("name") != "y"])
)
_mutant("openapi-other-default", "openapi-operations", "/openapi.json names another default of a parameter.").json(
    _OPENAPI,
    field(
        f"paths.{PLAN}.get.parameters",
        lambda all_: [{**item, "schema": _with_default(item["schema"])} for item in all_],
    ),
)
_mutant("openapi-too-strict", "openapi-answers", "/openapi.json forbids values that the robot accepts.").json(
    _OPENAPI,
    field(
        f"paths.{PLAN}.get.parameters",
        lambda all_: [{**item, "schema": {**item["schema"], "const": -1}} for item in all_],
    ),
)
_mutant("openapi-other-name", "openapi-answers", "/openapi.json requires a field that no response has.").json(
    _OPENAPI, lambda told: _rename(told, "child_frame_id", "child_frame")
)
_mutant("openapi-invalid", "openapi", "/openapi.json is not a valid OpenAPI document.").json(
    _OPENAPI, both(without("info"), field("paths", list))
)
_mutant("wadl-other-default", "wadl-resources", "/application.wadl names another default of a parameter.").xml(
    _WADL, each("param", lambda node: node.set("default", "0.5") if node.get("name") == "tolerance" else None)
)


_wsdl_mutant = MUTANTS.of_class("describe", "soap")

_WSDL = "http://schemas.xmlsoap.org/wsdl/"
_XSD = "http://www.w3.org/2001/XMLSchema"
_SOAP = "http://schemas.xmlsoap.org/wsdl/soap/"
_W, _S, _X = f"{{{_WSDL}}}", f"{{{_SOAP}}}", f"{{{_XSD}}}"


def _description(request: Request) -> bool:
    return wsdls(request) and request.query.lower() == "wsdl"


def _edit_wsdl(edit: Callable[[Any], object]) -> Make:
    """Return a change that applies ``edit`` to the WSDL's root element."""
    return altered(_description, tree(edit))


def _edit_schemas(edit: Callable[[Any], object]) -> Make:
    """Return a change that applies ``edit`` to each schema with declarations, in the WSDL or imported."""

    def apply(root: Any) -> None:
        for schema in root.iter(f"{_X}schema"):
            if len(schema) and schema.find(f"{_X}import") is None:
                edit(schema)

    return altered(wsdls, tree(apply))


def _all(path: str, edit: Callable[[Any], object], which: slice = slice(None)) -> Make:
    """Return a change that applies ``edit`` to the WSDL's elements at a path, or to some of them."""

    def apply(root: Any) -> None:
        for node in root.findall(path)[which]:
            edit(node)

    return _edit_wsdl(apply)


def _first(path: str, edit: Callable[[Any], object]) -> Make:
    return _all(path, edit, slice(1))


def _set(name: str, value: str) -> Callable[[Any], None]:
    return lambda node: node.set(name, value)


def _twice(node: Any) -> None:
    node.addnext(etree.fromstring(etree.tostring(node)))


@_wsdl_mutant("wsdl-import-gone", "wsdl", "A document that the WSDL imports returns 404.")
def _broken_import(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _description(request):
        imported = f'<x:schema xmlns:x="{_XSD}"><x:import namespace="{TNS}" schemaLocation="gone.xsd"/></x:schema>'
        body = re.sub(rb"<([\w]+:)?schema\b.*</([\w]+:)?schema>", imported.encode(), response.body, flags=re.DOTALL)
        response.body = body
    elif wsdls(request) or request.path.endswith("gone.xsd"):
        return plain(404, b"gone", "text/plain")(request)
    return response


@_wsdl_mutant("wsdl-operation-lost", "wsdl-operations", "The WSDL lacks an operation.").through(_edit_wsdl)
def _operation_lost(root: Any) -> None:
    for node in (root.find(_OPERATION), root.find(f"{_BINDING}/{_W}operation")):
        remove(node)


def _typed_part(node: Any) -> None:
    node.attrib.pop("element", None)
    node.set("type", f"{_prefix(node)}:deliveryRequestMessage")


def _prefix(node: Any) -> str:
    return next((key for key, value in node.nsmap.items() if key and "soap.turtlebot" in value), "tns")


@_wsdl_mutant("wsdl-import-in-types", "wsdl-R2003", "xsd:import is a direct child of wsdl:types.").through(_edit_wsdl)
def _import_in_types(root: Any) -> None:
    types = root.find(f"{_W}types")
    made = etree.Element(f"{_X}import")
    made.set("namespace", TNS)
    types.insert(0, made)


@_wsdl_mutant("wsdl-strange-element", "wsdl-R2028", "The WSDL has an element that WSDL 1.1 does not define.").through(
    _edit_wsdl
)
def _strange(root: Any) -> None:
    etree.SubElement(root, f"{_W}robot").set("name", "turtlebot")


@_wsdl_mutant("wsdl-same-signature", "wsdl-R2710", "Two operations have the same input element.").through(_edit_wsdl)
def _same_element(root: Any) -> None:
    parts = [part for part in root.iter(f"{_W}part") if not part.get("element", "").endswith("Response")]
    if len(parts) > 1:
        parts[1].set("element", parts[0].get("element"))


@_wsdl_mutant("wsdl-two-parts", "wsdl-R2201", "A soap:body lists two parts.").through(_edit_wsdl)
def _two_parts(root: Any) -> None:
    for message in root.findall(f"{_W}message")[:1]:
        second = etree.SubElement(message, f"{_W}part")
        second.set("name", "more")
        second.set("element", message[0].get("element"))
    for body in list(root.iter(f"{_S}body"))[:1]:
        body.set("parts", "parameters more")


@_wsdl_mutant("wsdl-float", "wsdl-types", "The schema declares a double as float.").through(_edit_schemas)
def _float(schema: Any) -> None:
    for node in [node for node in schema.iter(f"{_X}element") if node.get("type", "").endswith("double")][:1]:
        node.set("type", node.get("type").replace("double", "float"))


def _long_sequence(edit: Callable[[Any], object]) -> Make:
    """Return a change that applies ``edit`` to the first sequence of more than two elements in each schema."""

    def apply(schema: Any) -> None:
        for sequence in [item for item in schema.iter(f"{_X}sequence") if len(item) > 2][:1]:
            edit(sequence)

    return _edit_schemas(apply)


def _inline_no_target(root: Any) -> None:
    """Add a schema without targetNamespace to wsdl:types."""
    for schema in find_named(root, "schema")[:1]:
        made = etree.Element(f"{_X}schema")
        etree.SubElement(made, f"{_X}element").set("name", "homeless")
        schema.addnext(made)


_OPERATION = f"{_W}portType/{_W}operation"
_BINDING = f"{_W}binding"
_TRANSPORT = f"{_BINDING}/{_S}binding"

_wsdl_mutant("wsdl-order", "wsdl-types", "The schema has the elements of a sequence in another order.").made(
    _long_sequence(lambda sequence: sequence.append(sequence[0]))
)
_wsdl_mutant("wsdl-optional", "wsdl-types", "A required element is optional in the schema.").made(
    _long_sequence(lambda sequence: sequence[0].set("minOccurs", "0"))
)
_wsdl_mutant("wsdl-part-of-nothing", "wsdl-R2206", "A message part refers to an element that does not exist.").made(
    _first(f"{_W}message/{_W}part", lambda node: node.set("element", f"{_prefix(node)}:NothingAtAll"))
)
_wsdl_mutant("wsdl-no-transport", "wsdl-R2701", "The binding has no transport.").made(
    _all(_TRANSPORT, lambda node: node.attrib.pop("transport", None))
)
