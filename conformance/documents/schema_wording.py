"""Say what changed in a schema, as text that follows the name of the place."""

from __future__ import annotations

import json
from typing import Any, Final

from conformance.documents.json_schema import Schema

_SIMPLE: Final = (str, int, float, list)
_EXAMPLE: Final = 80
_WITHOUT: Final = "none"


def name_of(schema: Any, example: str = "") -> str:
    """Return what a shape is: its values or its type, and a value where the type says little."""
    if not isinstance(schema, dict):
        return example or "anything"
    if "const" in schema or "enum" in schema:
        return _shown(schema.get("enum", [schema.get("const")]))
    kind = str(schema.get("type") or "anything")
    return f"{kind}, for example {cut(example)}" if example and kind in {"object", "array"} else kind


def type_text(kinds: tuple[str, ...]) -> str:
    """Return types as text."""
    return " or ".join(kinds) or "any"


def differing(old: Any, new: Any) -> str:
    """Return the words whose values differ."""
    if not (isinstance(old, dict) and isinstance(new, dict)):
        return ""
    return ", ".join(sorted(key for key in old.keys() | new.keys() if old.get(key) != new.get(key)))


def change_text(word: str, old: Schema, new: Schema, *, request: bool) -> str:
    """Return the change of a word as text."""
    if word in {"enum", "const"}:
        return _values(old, new, request=request)
    before, after = old.get(word), new.get(word)
    if word == "uniqueItems":
        return f": items must {'' if after else 'not '}differ"
    if all(one is None or isinstance(one, _SIMPLE) for one in (before, after)):
        return f": {word} {_shown(before)} → {_shown(after)}"
    return f": {word} is {'new' if before is None else 'gone' if after is None else 'another'}"


def _values(old: Schema, new: Schema, *, request: bool) -> str:
    before, after = (one.get("enum", [one["const"]] if "const" in one else None) for one in (old, new))
    if [] in (before, after):
        # The schema `false`.
        return f": {'no value is' if after == [] else 'values are'} allowed now"
    if before is None or after is None:
        return f": values {_shown(before)} → {_shown(after)}"
    fewer = [one for one in before if one not in after]
    more = [one for one in after if one not in before]
    # What breaks comes first.
    texts = [f"may no longer be {_shown(fewer)}" if fewer else "", f"may now be {_shown(more)}" if more else ""]
    return " " + ", and ".join(text for text in (texts if request else texts[::-1]) if text)


def below(name: str, text: str) -> str:
    """Return what changed in a member: its name before that of its own member."""
    if text.startswith(", member "):
        return f", member {name}.{text.removeprefix(', member ')}"
    return f", member {name}{text}"


def _shown(value: Any) -> str:
    if value is None:
        return _WITHOUT
    values = value if isinstance(value, list) else [value]
    return ", ".join(one if isinstance(one, str) else json.dumps(one) for one in values) or _WITHOUT


def cut(text: str) -> str:
    """Return an example that is not too long to be read."""
    return text if len(text) <= _EXAMPLE else f"{text[:_EXAMPLE]}…"
