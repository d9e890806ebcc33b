"""The calls of a motion map: the operation that each names, and the short forms that people may write.

A path may have values in place of a description's parameters: `PUT /robots/7/velocity` names
`PUT /robots/{id}/velocity`, and so does `PUT /robots/{id}/velocity` with `[values] id = [7]`. A `direction` is a member
of a body that says the sign of a number, which is then sent without it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final
from urllib.parse import quote

NAME: Final = re.compile(r"\{([^{}]+)\}")
"""A name in a template."""
#: The size of a number, in a template: "{ahead:size}".
SIZE: Final = "size"
#: The keys of what becomes one of two values, by the sign of a number.
SIGNED: Final = frozenset({"sign_of", "positive", "negative"})
_CALL: Final = re.compile(r"[A-Z]+ /\S*")


def shape_of(call: str) -> str:
    """Return an operation without the names in its path, which map and description may choose differently."""
    return NAME.sub("{}", call.partition("?")[0])


def names_operation(call: str, label: str) -> bool:
    """Return whether a map's call names an operation, by the method and path of its label."""
    return covers(label, shape_of(call))


def covers(call: str, sent: str) -> bool:
    """Return whether a call, with any values in its path, is the sent "METHOD PATH"."""
    pattern = "[^/]+".join(map(re.escape, NAME.split(call.partition("?")[0])[::2]))
    return re.fullmatch(pattern, sent.partition("?")[0]) is not None


def named_by(calls: Iterable[str], labels: Sequence[str]) -> set[str]:
    """Return the labels of the operations that calls name; one without a parameter in its place goes first."""
    found = set[str]()
    for call in calls:
        exact = [label for label in labels if shape_of(label) == shape_of(call)]
        found.update(exact or [label for label in labels if names_operation(call, label)])
    return found


def written_out(motion: Any, values: Mapping[str, Sequence[Any]]) -> Any:
    """Return the tables of a map with the values of path parameters, and with directions as parts of templates.

    Args:
        motion: the table `motion` of a statement, as read.
        values: values of the table `values`.
    """
    if not isinstance(motion, Mapping):
        return motion
    axes = _axes(motion)
    known = {name: given[0] for name, given in values.items() if given and name not in axes}
    return _with_values({name: _put_direction(table) for name, table in motion.items()}, known)


def _axes(motion: Mapping[str, Any]) -> set[str]:
    """Return the names of axes and velocities, which templates keep."""
    tables = [motion.get("state"), motion.get("velocity")]
    found = [table.get("axes") for table in tables if isinstance(table, Mapping)]
    return set().union(*(item for item in found if isinstance(item, Mapping)))


def _with_values(value: Any, known: Mapping[str, Any]) -> Any:
    if isinstance(value, Mapping):
        return {_with_values(name, known): _with_values(item, known) for name, item in value.items()}
    if isinstance(value, list):
        return [_with_values(item, known) for item in value]
    if not isinstance(value, str) or not _CALL.fullmatch(value):
        return value
    return NAME.sub(lambda found: quote(str(known[found[1]]), safe="") if found[1] in known else found[0], value)


def _put_direction(table: Any) -> Any:
    """Return a table with its direction as a part of its body.

    Raises:
        ValueError: it has no body, or it does not say which of several numbers it is the direction of.
    """
    if not isinstance(table, Mapping) or "direction" not in table:
        return table
    given, body = table["direction"], table.get("body")
    rest = {name: item for name, item in table.items() if name != "direction"}
    if (
        not isinstance(given, Mapping)
        or not {"at", "positive", "negative"} <= given.keys()
        or not isinstance(body, dict)
    ):
        raise ValueError('direction = { at = "/member", positive = 0, negative = 1 } is for a table with a body')
    named = sorted(one for one in _names(body) if ":" not in one and one != "seconds")
    axis = given.get("of", named[0] if len(named) == 1 else None)
    if axis not in named:
        raise ValueError(f"direction: of = must name one of {', '.join(named)}")
    sized = _with_sizes(body, axis)
    *folders, last = str(given["at"]).strip("/").split("/")
    place = sized
    for folder in folders:
        place = place.setdefault(folder, {})
    place[last] = {"sign_of": axis, "positive": given["positive"], "negative": given["negative"]}
    return {**rest, "body": sized}


def _with_sizes(value: Any, axis: str) -> Any:
    if isinstance(value, dict):
        return {name: _with_sizes(item, axis) for name, item in value.items()}
    if isinstance(value, list):
        return [_with_sizes(item, axis) for item in value]
    return value.replace(f"{{{axis}}}", f"{{{axis}:{SIZE}}}") if isinstance(value, str) else value


def _names(value: Any) -> set[str]:
    if isinstance(value, dict):
        return set().union(*map(_names, value.values()))
    if isinstance(value, list):
        return set().union(*map(_names, value))
    return set(NAME.findall(value)) if isinstance(value, str) else set()
