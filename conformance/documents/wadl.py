"""Read the operations of a WADL (W3C member submission, 2009)."""

import re
from urllib.parse import urlsplit

from lxml import etree

from conformance.documents.openapi import Operation
from conformance.documents.parameters import Parameter
from conformance.documents.representation import UnreadableError, local_name, parse_xml
from conformance.documents.xml import elements

WADL = "http://wadl.dev.java.net/2009/02"
# A path parameter, perhaps with a regular expression: {code: [0-9]{1,3}}.
_TEMPLATE = re.compile(r"\{\s*([^{}:\s]+)\s*(?::[^{}]*(?:\{[^{}]*\}[^{}]*)*)?\}")
_KINDS = {"template": "path", "query": "query", "matrix": "matrix", "header": "header", "plain": "plain"}


def read_wadl(body: bytes) -> list[Operation]:
    """Return the operations of a WADL, with paths relative to the server's root.

    Raises:
        UnreadableError: it is not XML, or its root is not a WADL application.
    """
    root = parse_xml(body)
    if root.tag != f"{{{WADL}}}application":
        raise UnreadableError(f"the root element {root.tag}")
    found: list[Operation] = []
    for resources in root.findall(f"{{{WADL}}}resources"):
        prefix = urlsplit(resources.get("base", "")).path.rstrip("/")
        for resource in resources.findall(f"{{{WADL}}}resource"):
            found += _of_resource(resource, prefix, {}, root)
    return found


def _of_resource(
    element: etree._Element, prefix: str, inherited: dict[tuple[str, str], Parameter], root: etree._Element
) -> list[Operation]:
    path = f"{prefix}/{element.get('path', '').lstrip('/')}" if element.get("path") else prefix
    parameters = inherited | _parameters(element)
    found: list[Operation] = []
    for child in elements(element):
        if local_name(child) == "resource":
            found += _of_resource(child, path.rstrip("/"), parameters, root)
        elif local_name(child) == "method":
            method = _method_of(child, root)
            own = parameters
            for request in method.findall(f"{{{WADL}}}request"):
                own |= _parameters(request)
            name, template = method.get("name", "").upper(), _TEMPLATE.sub(r"{\1}", path)
            found.append(Operation(f"{name} {template}", name, template, tuple(own.values())))
    return found


def _method_of(method: etree._Element, root: etree._Element) -> etree._Element:
    """Return a method element, or the element that its ``href="#id"`` names."""
    name = method.get("href", "").lstrip("#")
    return next((item for item in root.iter(f"{{{WADL}}}method") if name and item.get("id") == name), method)


def _parameters(element: etree._Element) -> dict[tuple[str, str], Parameter]:
    found = {}
    for item in element.findall(f"{{{WADL}}}param"):
        where, name = _KINDS.get(item.get("style", ""), item.get("style", "")), item.get("name", "")
        required = where == "path" or item.get("required", "false") in {"true", "1"}
        default = {"default": item.get("default")} if item.get("default") is not None else {}
        found[where, name] = Parameter(name, where, required, default)
    return found
