"""Robots whose lists of sensors and services are not what they should be."""

import re
from typing import Any

from conformance.mutation.changes import altered, rest, values
from conformance.mutation.mutant import Mutant, of_class
from conformance.packs.table1.mutants.paths import SENSORS, SERVICES


def _first(edit: Any) -> Any:
    def apply(items: Any) -> None:
        if items:
            edit(items[0])

    return values(apply)


_mutant = of_class("rest-resources", "rest")


def _both(name: str, path: str) -> tuple[Mutant, ...]:
    at = rest("GET", path)
    in_full = re.compile("/(msg|srv|action)/")
    return (
        _mutant(
            f"{name}-without-type",
            f"An entry of the {name} has no type.",
            f"{name}-type",
            altered(at, _first(lambda item: item.pop("type"))),
        ),
        _mutant(
            f"{name}-in-an-object",
            f"The {name} are an object with a list in it.",
            f"{name}-type",
            altered(at, values(lambda items: {"items": items})),
        ),
        _mutant(
            f"{name}-twice",
            f"The first of the {name} is listed twice.",
            f"{name}-unique",
            altered(at, values(lambda items: [*items, *items[:1]])),
        ),
        _mutant(
            f"{name}-short-names",
            f"Types of the {name} are not named in full.",
            f"{name}-named-in-full",
            altered(at, _first(lambda item: item.update(type=in_full.sub("/", item["type"])))),
        ),
        _mutant(
            f"{name}-flicker",
            f"Every other time the last of the {name} is missing.",
            f"{name}-stable",
            altered(at, values(lambda items: items[:-1]), nth=2),
        ),
    )


MUTANTS = (*_both("sensors", SENSORS), *_both("services", SERVICES))
