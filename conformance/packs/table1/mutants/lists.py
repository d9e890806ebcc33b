"""Mutants with faults in the lists of sensors and services."""

import re

from conformance.mutation.changes import rest
from conformance.mutation.fields import field, without
from conformance.mutation.table import Table
from conformance.packs.table1.mutants.paths import SENSORS, SERVICES

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-resources", "rest")
_KIND = re.compile("/(msg|srv|action)/")

for _name, _at in (("sensors", rest("GET", SENSORS)), ("services", rest("GET", SERVICES))):
    _mutant(f"{_name}-without-type", f"{_name}-type", f"The first entry of the {_name} has no type.").json(
        _at, without("0.type")
    )
    _mutant(f"{_name}-in-an-object", f"{_name}-type", f"The {_name} are an object that holds the list.").json(
        _at, lambda items: {"items": items}
    )
    _mutant(f"{_name}-twice", f"{_name}-unique", f"The first of the {_name} is listed twice.").json(
        _at, lambda items: [*items, *items[:1]]
    )
    _mutant(f"{_name}-short-names", f"{_name}-named-in-full", f"Types of the {_name} lack msg, srv or action.").json(
        _at, field("0.type", lambda type_: _KIND.sub("/", type_))
    )
    _mutant(f"{_name}-flicker", f"{_name}-stable", f"Every other response lacks the last of the {_name}.").json(
        _at, lambda items: items[:-1], nth=2
    )
