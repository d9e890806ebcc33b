"""A motion map as TOML, as a person writes and reads it; and requests of a map that the description forbids."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from conformance.api.rest.validity import INVALID, validity
from conformance.contract.toml_file import basic_string as string
from conformance.documents.json_schema import Schema, is_numeric
from conformance.documents.wsdl_pack import services_of
from conformance.engine.commanded import DEPTH, Commanded, list_length, members_in, numbers_in, parts_of, usual_value
from conformance.scenarios.motion.binding import JsonBinding
from conformance.scenarios.motion.templates import NoValueError, fill, quaternion_of
from conformance.statement.motion_map import MotionMap, Velocity
from conformance.statement.statement import StatementError
from conformance.verdict.run import Run


def check_map(run: Run, statement: Path | None) -> None:
    """Check that the description forbids no command of the motion map within its limits.

    Args:
        run: with the map and the contract of a device that has an OpenAPI description.
        statement: the file that has the map, to name the line; None if there is none.

    Raises:
        StatementError: it forbids one.
    """
    motion = run.statement.motion_map
    if motion is None or not run.contract.openapi_path or services_of(run.contract) is not None:
        return
    binding = JsonBinding.of(run.contract)
    for table, call, body, media_type, root in _commands(motion):
        made = binding.make(call, body, *((media_type, root) if root or media_type else ()))
        said = validity(run.contract, made.method, made.target, made.content_type, made.body)
        if said.verdict == INVALID:
            where = _place(statement, table)
            shown = made.body[:300].decode("utf-8", "replace")
            raise StatementError(
                f"{where}[{table}] would send {made.method} {made.target} {shown}".rstrip()
                + f", within the limits of the map, and the description forbids it: {said.why}"
            )


def _place(statement: Path | None, table: str) -> str:
    """Return file and line of a table, as the beginning of a message; empty if they are not known."""
    if statement is None:
        return ""
    try:
        lines = statement.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return f"{statement}: "
    heading = re.compile(rf"\s*\[{{1,2}}\s*{re.escape(table)}\s*\]")
    number = next((number for number, line in enumerate(lines, 1) if heading.match(line)), None)
    return f"{statement}, line {number}: " if number else f"{statement}: "


_Command = tuple[str, str, Any, str, str]
"""Table, call, body, and media type and root where the map says them."""


def _commands(motion: MotionMap) -> Iterator[_Command]:
    """Yield commands within the limits."""
    yield from _moves(motion)
    if motion.velocity:
        yield from _velocities(motion.velocity)
    if motion.stop:
        yield from _fill("motion.stop", motion.stop.send, motion.stop.body, {})
    for name, switch in motion.switches.items():
        for value in switch.values:
            yield from _fill(f"motion.switches.{name}", switch.send, switch.body, {"value": value})


def _moves(motion: MotionMap) -> Iterator[_Command]:
    goto, axes = motion.goto, motion.state.axes
    if goto is None or goto.relative:
        return
    middle = {name: sum(axis.limits) / 2 for name, axis in axes.items()}
    for name, limit in ((name, limit) for name, axis in axes.items() for limit in axis.limits):
        values: dict[str, Any] = {**middle, name: limit, "seconds": goto.seconds}
        for one, turned in axes.items():
            values |= quaternion_of(one, values[one], turned)
        yield from _fill("motion.goto", goto.send, goto.body, values)


def _velocities(velocity: Velocity) -> Iterator[_Command]:
    for name, speed in velocity.axes.items():
        for value in (*speed.limits, 0.0):
            values = {**dict.fromkeys(velocity.axes, 0.0), name: value}
            yield from _fill("motion.velocity", velocity.send, velocity.body, values)
            for way in velocity.ways:
                yield from _fill("motion.velocity.ways", way.send, way.body, values, way.media_type, way.root)


def _fill(
    table: str, call: str, body: Any, values: Mapping[str, Any], media_type: str = "", root: str = ""
) -> Iterator[_Command]:
    """Yield a command with its values, unless it needs values that only the device knows."""
    try:
        yield table, fill(call, values), fill(body, values), media_type, root
    except NoValueError:
        return


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
        schema: the schema of the body.
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
