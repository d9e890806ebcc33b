"""Robots whose lists of sensors and services are not what they should be."""

from typing import Any

from conformance.selftest.mutants.changes import SENSORS, SERVICES, altered, rest, values
from conformance.selftest.mutants.mutant import Mutant


def _first(edit: Any) -> Any:
    def apply(items: Any) -> None:
        if items:
            edit(items[0])

    return values(apply)


def _both(name: str, path: str, requirement: str) -> tuple[Mutant, ...]:
    at = rest("GET", path)
    return (
        Mutant(
            f"{name}-without-type",
            f"An entry of the {name} has no type.",
            (f"rest-resources/{requirement}-type",),
            "rest",
            altered(at, _first(lambda item: item.pop("type"))),
        ),
        Mutant(
            f"{name}-in-an-object",
            f"The {name} are an object with a list in it.",
            (f"rest-resources/{requirement}-type",),
            "rest",
            altered(at, values(lambda items: {"items": items})),
        ),
        Mutant(
            f"{name}-twice",
            f"The first of the {name} is listed twice.",
            (f"rest-resources/{requirement}-unique",),
            "rest",
            altered(at, values(lambda items: [*items, *items[:1]])),
        ),
        Mutant(
            f"{name}-short-names",
            f"Types of the {name} are not named in full.",
            (f"rest-resources/{requirement}-named-in-full",),
            "rest",
            altered(
                at,
                _first(
                    lambda item: item.update(
                        type=item["type"].replace("/msg/", "/").replace("/srv/", "/").replace("/action/", "/")
                    )
                ),
            ),
        ),
        Mutant(
            f"{name}-flicker",
            f"Every other time the last of the {name} is missing.",
            (f"rest-resources/{requirement}-stable",),
            "rest",
            altered(at, values(lambda items: items[:-1]), nth=2),
        ),
    )


MUTANTS = (*_both("sensors", SENSORS, "sensors"), *_both("services", SERVICES, "services"))
