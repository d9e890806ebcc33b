"""Write different values to several things of a collection, and read all of them before and after each write."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final
from urllib.parse import quote

from conformance.api.rest.things import collection_of, creator_of, parts_of
from conformance.documents.openapi import Operation, is_json
from conformance.scenarios.creating import created_path, path_of_usual
from conformance.scenarios.singletons import is_changeable, is_free
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer, members

_WRITTEN = 2  # things that are written
_TURNS = 2  # how often each of them is written
_OTHERS = 3  # other things, which are only read
_FIRST: Final = 51  # number from which the first values are made


def write_siblings(surveyor: Surveyor, operations: Mapping[tuple[str, str], Operation]) -> None:
    """Write to things of each collection: to those that are created for this, or, without a creation, to some there."""
    writer, values = Writer(surveyor.api, surveyor.values), surveyor.values
    for (method, template), read in operations.items():
        changes = [operations[name, template] for name in ("PATCH", "PUT") if (name, template) in operations]
        changes = [one for one in changes if is_json(next(iter(one.bodies), "")) and is_free(one, template)]
        if method != "GET" or not collection_of(template) or not changes:
            continue
        surveyor.api.run.limit.check()
        create, delete = creator_of(operations, read), operations.get(("DELETE", template))
        made = [created_path(surveyor, create, read) for _ in range(_WRITTEN)] if create and delete else []
        made = [path for path in made if path]
        usual = path_of_usual(read, values).rstrip("/").rpartition("/")[0]
        above = made[0].rstrip("/").rpartition("/")[0] if made else usual
        ids = values.known_ids(read, read.parameter("path")[-1]) if above == usual else []
        there = [path for one in ids if (path := f"{above}/{quote(str(one), safe='')}") not in made]
        written = made if create else there[:_WRITTEN]
        beside = dict.fromkeys([*written, *there[: _OTHERS + len(written)]])
        before = {path: members(writer.send(read, path), ()) for path in beside}
        lister = operations.get(("GET", collection_of(template)))
        steps = [(turn, number, path) for turn in range(_TURNS) for number, path in enumerate(written)]
        for turn, number, path in steps if len(beside) > 1 else ():
            change = changes[turn % len(changes)]
            now = members(writer.send(read, path), ())
            if body := _other_values(writer, change, _FIRST + _WRITTEN * turn + number, now, is_own=bool(made)):
                writer.conditional(change, read, path, body)
                for one in beside:
                    writer.send(read, one)
                if lister is not None:
                    writer.send(lister, above)
        for path in written:
            if made and delete is not None:
                writer.conditional(delete, read, path)
            elif restored := writer.bodies(changes[0], 0, before[path])[1:2]:
                writer.conditional(changes[0], read, path, restored[0])


def _other_values(writer: Writer, change: Operation, turn: int, now: dict[str, Any], *, is_own: bool) -> dict[str, Any]:
    """Return a body with other values, but for members that each thing has for itself; empty if there is none."""
    made, unique = next(iter(writer.bodies(change, turn, now)), {}), writer.values.unique.names(change)
    parts = parts_of(change.bodies[next(iter(change.bodies))].schema)
    kept = {name for name in made if not (is_own or is_changeable(name, parts[name], writer.values.collections))}
    if change.method == "PATCH":
        return {name: one for name, one in made.items() if name not in {*kept, *unique}}
    return {} if unique else {name: now.get(name, one) if name in kept else one for name, one in made.items()}
