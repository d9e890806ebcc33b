"""Bodies that the contract does not allow, made from ones that it does: each would move the robot if it were taken."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterator

_JSON: Final = "application/json"


def invalid_bodies(valid: dict[str, Any], number: str) -> Iterator[tuple[str, str, bytes]]:
    """Make bodies that have to be refused.

    Args:
        valid: a body that is taken.
        number: where a number stands in it, as "goal.target_pose.pose.position.x".

    Yields:
        What is wrong, media type, body.
    """
    text = json.dumps(valid)
    *parents, last = number.split(".")
    for what, value in (
        ("a string for a number", "0.1"),
        ("null for a number", None),
        ("true for a number", True),
        ("a list for a number", [0.1]),
        ("an object for a number", {}),
    ):
        yield f"{what} in {number}", _JSON, json.dumps(_with(valid, number, value)).encode()
    for literal in ("NaN", "Infinity", "-Infinity", "1e400"):
        marked = json.dumps(_with(valid, number, "MARK"))
        yield f"{literal} in {number}", _JSON, marked.replace('"MARK"', literal).encode()
    yield f"no {number}", _JSON, json.dumps(_without(valid, number)).encode()
    top = number.split(".", maxsplit=1)[0]
    yield f"no {top}", _JSON, json.dumps({key: value for key, value in valid.items() if key != top}).encode()
    yield "an unknown field", _JSON, json.dumps({**valid, "no_such_field": 1}).encode()
    where = ".".join(parents)
    if where:
        unknown = _with(valid, f"{where}.no_such_field", 1)
        yield f"an unknown field in {where}", _JSON, json.dumps(unknown).encode()
    first = json.dumps(top)
    yield f"{top} twice", _JSON, f"{{{first}: {json.dumps(valid[top])}, {text[1:]}".encode()
    marked = json.dumps(_with(valid, number, "MARK"))
    yield f"{number} twice", _JSON, marked.replace('"MARK"', f'0.0, "{last}": {_at(valid, number)!r}').encode()
    yield "a list as root", _JSON, f"[{text}]".encode()
    yield "text after the end", _JSON, f"{text} {text}".encode()
    yield "a missing bracket", _JSON, text[:-1].encode()
    yield "text/plain", "text/plain", text.encode()


def _at(value: Any, path: str) -> Any:
    for name in path.split("."):
        value = value[name]
    return value


def _with(value: Any, path: str, new: Any) -> Any:
    name, _, rest = path.partition(".")
    return {**value, name: _with(value[name], rest, new) if rest else new}


def _without(value: Any, path: str) -> Any:
    name, _, rest = path.partition(".")
    if not rest:
        return {key: item for key, item in value.items() if key != name}
    return {**value, name: _without(value[name], rest)}
