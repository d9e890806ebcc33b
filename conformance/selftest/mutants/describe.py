"""Robots whose REST descriptions do not agree with what they do."""

import re
from collections.abc import Callable
from typing import Any

from conformance.selftest.messages import Request
from conformance.selftest.mutants.changes import (
    SENSORS,
    altered,
    instead,
    named,
    plain,
    problem,
    rest,
    text,
    tree,
    values,
)
from conformance.selftest.mutants.mutant import of_class

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


def _missing(path: str) -> Callable[[Request], bool]:
    return lambda request: request.side == "rest" and request.path == path


def _resource_lost(root: Any) -> None:
    for node in named(root, "resource"):
        if re.search("sensors/?$", node.get("path", "")):
            node.getparent().remove(node)


def _method_lost(root: Any) -> None:
    for node in named(root, "method"):
        if node.get("name") == "DELETE":
            node.getparent().remove(node)


def _parameter_lost(root: Any) -> None:
    for node in named(root, "param"):
        if node.get("name") in {"y", "source_y"}:
            node.getparent().remove(node)


_mutant = of_class("describe", "rest")

MUTANTS = (
    _mutant("openapi-gone", "There is no /openapi.json.", "openapi", instead(_OPENAPI, problem(404, "no description"))),
    _mutant("openapi-invalid", "/openapi.json is no OpenAPI.", "openapi", altered(_OPENAPI, values(_invalid))),
    _mutant(
        "openapi-yaml",
        "/openapi.json is YAML.",
        "openapi",
        instead(_OPENAPI, plain(200, b"openapi: 3.1.0\npaths: {}\n", "application/yaml")),
    ),
    _mutant(
        "openapi-without-path",
        "/openapi.json lacks a path.",
        "openapi-operations",
        altered(_OPENAPI, values(_without_path)),
    ),
    _mutant(
        "openapi-without-method",
        "/openapi.json lacks a method.",
        "openapi-operations",
        altered(_OPENAPI, values(_without_method)),
    ),
    _mutant(
        "openapi-without-parameter",
        "/openapi.json lacks a parameter.",
        "openapi-operations",
        altered(_OPENAPI, values(_without_parameter)),
    ),
    _mutant(
        "openapi-promises",
        "/openapi.json has a path that is not there.",
        "openapi-behaviour",
        altered(_OPENAPI, values(_promised)),
    ),
    _mutant(
        "openapi-resource-lost",
        "A resource of the contract is 404.",
        "openapi-behaviour",
        instead(_missing(SENSORS), problem(404, "nothing is here")),
    ),
    _mutant("wadl-gone", "There is no /application.wadl.", "wadl", instead(_WADL, problem(404, "no description"))),
    _mutant("wadl-broken", "/application.wadl is not closed.", "wadl", altered(_WADL, text(r"</[\w:]+>\s*$", ""))),
    _mutant(
        "wadl-without-resource",
        "/application.wadl lacks a resource.",
        "wadl-resources",
        altered(_WADL, tree(_resource_lost)),
    ),
    _mutant(
        "wadl-without-method", "/application.wadl lacks a method.", "wadl-resources", altered(_WADL, tree(_method_lost))
    ),
    _mutant(
        "wadl-without-parameter",
        "/application.wadl lacks a parameter.",
        "wadl-resources",
        altered(_WADL, tree(_parameter_lost)),
    ),
)
