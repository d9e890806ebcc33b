"""A motion map as TOML, as a person writes and reads it: its values, and the bodies of its commands."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from conformance.contract.toml_file import basic_string as string
from conformance.documents.json_schema import Schema, is_numeric
from conformance.engine.commanded import DEPTH, Commanded, list_length, members_in, numbers_in, parts_of, usual_value

__all__ = ["inline", "key", "string"]

# A bare key in TOML 1.0.
_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")


def key(name: str) -> str:
    """Return a name as a key."""
    return name if _BARE.fullmatch(name) else string(name)


def inline(value: Any) -> str:
    """Return a value on one line."""
    if isinstance(value, dict):
        inside = ", ".join(f"{key(name)} = {inline(one)}" for name, one in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(inline, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value) if isinstance(value, int) else string(str(value))


def direction_line(number: Commanded) -> str:
    """Return the line of a map that says where a body has the sign of a number."""
    given = dict(zip(("at", "positive", "negative"), number.direction or (), strict=True))
    return f"direction = {inline({**given, 'of': number.name})}"


def template_of(schema: Schema, names: Mapping[str, str], at: str = "", depth: int = DEPTH) -> Any:
    """Return a body with a template at some places, and values for the other required members.

    Args:
        schema: of the body.
        names: templates, or values, by JSON pointer.
        at: the pointer of this part.
        depth: so deep at most.
    """
    made: dict[str, Any] = {}
    is_list = False
    for part in _choose_parts(schema, names, at) if depth else ():
        required, is_list = part.get("required", ()), is_list or bool(list_length(part))
        for step, member in members_in(part):
            place, name = f"{at}/{step}", step.replace("~1", "/").replace("~0", "~")
            is_needed = name in required or is_list
            if name in made:
                continue
            if place in names:
                made[name] = names[place]
            elif is_numeric(member) and re.search(r"duration|seconds", name, re.IGNORECASE):
                made[name] = "{seconds}"
            elif any(one.startswith(f"{place}/") for one in names) or (
                is_needed and any("properties" in one or list_length(one) for one in parts_of(member))
            ):
                made[name] = template_of(member, names, place, depth - 1)
            elif is_needed:
                made[name] = usual_value(member)
    return list(made.values()) if is_list else made


def _choose_parts(schema: Schema, names: Mapping[str, str], at: str) -> Iterator[Schema]:
    """Yield a schema's parts, with the alternative that has the most of the places."""
    yield schema
    for part in schema.get("allOf", ()):
        yield from _choose_parts(part, names, at)
    for key in ("anyOf", "oneOf"):
        ranked = sorted(
            (part for part in schema.get(key, ()) if isinstance(part, dict)),
            key=lambda part: sum(place in names for place, _ in numbers_in(part, at)),
        )
        if ranked:
            yield from _choose_parts(ranked[-1], names, at)
