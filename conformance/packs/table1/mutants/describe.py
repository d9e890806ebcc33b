"""Robots whose REST descriptions do not agree with what they do."""

import re
from collections.abc import Callable
from copy import deepcopy
from typing import Any

from conformance.mutation.changes import Make, altered, instead, plain, problem, rest, text, values
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import SENSORS
from conformance.packs.table1.mutants.xml_trees import each, gone, tree

_OPENAPI, _WADL = rest("GET", "/openapi.json"), rest("GET", "/application.wadl")


def _without_path(description: Any) -> None:
    description["paths"].pop(SENSORS, None)


def _without_method(description: Any) -> None:
    description["paths"]["/robot/navigation/action/goal/"].pop("delete", None)


def _without_parameter(description: Any) -> None:
    operation = description["paths"]["/robot/navigation/service/plan"]["get"]
    operation["parameters"] = [one for one in operation["parameters"] if one.get("name") != "y"]


def _promised(description: Any) -> None:
    description["paths"]["/robot/arm/"] = {"get": {"responses": {"200": {"description": "the arm"}}}}


def _invalid(description: Any) -> None:
    description.pop("info", None)
    description["paths"] = [*description["paths"]]


def _told(edit: Callable[[Any], Any]) -> Make:
    """The OpenAPI description is altered."""
    return altered(_OPENAPI, values(edit))


def _lost(name: str, attribute: str, pattern: str) -> Make:
    """The WADL lacks the elements of which an attribute is written so."""

    def edit(node: Any) -> None:
        if re.search(pattern, node.get(attribute, "")):
            gone(node)

    return altered(_WADL, tree(each(name, edit)))


def _promised_twice(resource: Any) -> None:
    """Beside a resource the WADL has another one, which is not there."""
    other = deepcopy(resource)
    other.set("path", "/robot/arm/")
    resource.getparent().append(other)


_mutant = of_class("describe", "rest")

MUTANTS = (
    _mutant("openapi-gone", "There is no /openapi.json.", "openapi", instead(_OPENAPI, problem(404, "no description"))),
    _mutant("openapi-invalid", "/openapi.json is no OpenAPI.", "openapi", _told(_invalid)),
    _mutant(
        "openapi-yaml",
        "/openapi.json is YAML.",
        "openapi",
        instead(_OPENAPI, plain(200, b"openapi: 3.1.0\npaths: {}\n", "application/yaml")),
    ),
    _mutant("openapi-without-path", "/openapi.json lacks a path.", "openapi-operations", _told(_without_path)),
    _mutant("openapi-without-method", "/openapi.json lacks a method.", "openapi-operations", _told(_without_method)),
    _mutant(
        "openapi-without-parameter", "/openapi.json lacks a parameter.", "openapi-operations", _told(_without_parameter)
    ),
    _mutant("openapi-promises", "/openapi.json has a path that is not there.", "openapi-behaviour", _told(_promised)),
    _mutant(
        "openapi-resource-lost",
        "A resource of the contract is 404.",
        "openapi-behaviour",
        instead(rest("", SENSORS), problem(404, "nothing is here")),
    ),
    _mutant("wadl-gone", "There is no /application.wadl.", "wadl", instead(_WADL, problem(404, "no description"))),
    _mutant("wadl-broken", "/application.wadl is not closed.", "wadl", altered(_WADL, text(r"</[\w:]+>\s*$", ""))),
    _mutant(
        "wadl-promises",
        "/application.wadl has a resource that is not there.",
        "wadl-behaviour",
        altered(_WADL, tree(each("resource", _promised_twice, slice(0, 1)))),
    ),
    _mutant(
        "wadl-without-resource",
        "/application.wadl lacks a resource.",
        "wadl-resources",
        _lost("resource", "path", "sensors/?$"),
    ),
    _mutant(
        "wadl-without-method",
        "/application.wadl lacks a method.",
        "wadl-resources",
        _lost("method", "name", "^DELETE$"),
    ),
    _mutant(
        "wadl-without-parameter",
        "/application.wadl lacks a parameter.",
        "wadl-resources",
        _lost("param", "name", "^(source_)?y$"),
    ),
)
