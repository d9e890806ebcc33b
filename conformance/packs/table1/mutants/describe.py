"""Mutants whose OpenAPI or WADL description differs from their behaviour."""

import re
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from conformance.mutation.changes import Make, altered, rest
from conformance.mutation.fields import each as both
from conformance.mutation.fields import field, without
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, gone, tree
from conformance.packs.table1.mutants.paths import GOAL, PLAN, SENSORS

MUTANTS = Table()
_mutant = MUTANTS.of_class("describe", "rest")

_OPENAPI, _WADL = rest("GET", "/openapi.json"), rest("GET", "/application.wadl")


def _lost(name: str, attribute: str, pattern: str) -> Make:
    """Return a change that removes the WADL's elements ``name`` whose attribute matches the pattern."""

    def edit(node: Any) -> None:
        if re.search(pattern, node.get(attribute, "")):
            gone(node)

    return altered(_WADL, tree(each(name, edit)))


def _promised_twice(resource: Any) -> None:
    """Add a copy of a WADL resource with a path that does not exist."""
    other = deepcopy(resource)
    other.set("path", "/robot/arm/")
    resource.getparent().append(other)


def _defaulted(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema whose default, where it has a numeric one, is another."""
    return {**schema, "default": schema["default"] + 0.4} if isinstance(schema.get("default"), float) else schema


def _objects(node: Any) -> Iterator[dict[str, Any]]:
    """Yield each JSON object in a document."""
    if isinstance(node, dict):
        yield node
    for part in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from _objects(part)


def _renamed(told: Any, old: str, new: str) -> None:
    """Give a member another name in all schemas."""
    for node in list(_objects(told)):
        if isinstance(node.get("properties"), dict) and old in node["properties"]:
            node["properties"][new] = node["properties"].pop(old)
            node["required"] = [new if name == old else name for name in node.get("required", ())]


_mutant("openapi-without-path", "openapi-operations", "/openapi.json lacks a path.").json(
    _OPENAPI, lambda told: told["paths"].pop(SENSORS, None) and None
)
_mutant("openapi-without-method", "openapi-operations", "/openapi.json lacks a method.").json(
    _OPENAPI, lambda told: told["paths"][GOAL].pop("delete", None) and None
)
_mutant("openapi-without-parameter", "openapi-operations", "/openapi.json lacks a parameter.").json(
    _OPENAPI, field(f"paths.{PLAN}.get.parameters", lambda all_: [one for one in all_ if one.get("name") != "y"])
)
_mutant("openapi-other-default", "openapi-operations", "/openapi.json names another default of a parameter.").json(
    _OPENAPI,
    field(f"paths.{PLAN}.get.parameters", lambda all_: [{**one, "schema": _defaulted(one["schema"])} for one in all_]),
)
_mutant("openapi-too-strict", "openapi-answers", "/openapi.json forbids values that the robot accepts.").json(
    _OPENAPI,
    field(
        f"paths.{PLAN}.get.parameters", lambda all_: [{**one, "schema": {**one["schema"], "const": -1}} for one in all_]
    ),
)
_mutant("openapi-other-name", "openapi-answers", "/openapi.json requires a field that no response has.").json(
    _OPENAPI, lambda told: _renamed(told, "child_frame_id", "child_frame")
)
_mutant("openapi-invalid", "openapi", "/openapi.json is not a valid OpenAPI document.").json(
    _OPENAPI, both(without("info"), field("paths", list))
)
_mutant("wadl-other-default", "wadl-resources", "/application.wadl names another default of a parameter.").xml(
    _WADL, each("param", lambda node: node.set("default", "0.5") if node.get("name") == "tolerance" else None)
)
