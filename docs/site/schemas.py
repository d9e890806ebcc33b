"""The reference of result files, from their JSON Schemas."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

_SCHEMAS = Path(__file__).parents[2] / "reports" / "schemas"
_INTRODUCTION = """# Keys of result files

From the JSON Schemas in `reports/schemas/`. A dot leads into an object, `[]` into the items of a list, `{}` into the
values of an object with any names. [The command line](cli.md#result-files) has an overview with examples.
"""
_FILES = {"result": "result.json", "latency": "latency.json", "fleet": "fleet.json"}
_DEEPEST = 6


def page() -> str:
    """Return the page as Markdown."""
    lines = [_INTRODUCTION]
    for name, file in _FILES.items():
        schema = json.loads((_SCHEMAS / f"roaas-{name}-1.schema.json").read_text(encoding="utf-8"))
        lines += [f"## {file}\n", f"{_text(schema['title'])}. {_text(schema.get('description', ''))}\n"]
        lines += ["| key | type | meaning |", "|---|---|---|"]
        lines += (f"| `{path}` | {kind} | {meaning} |" for path, kind, meaning in _keys(schema, schema, "", 0))
        lines.append("")
    return "\n".join(lines)


def _keys(schema: Mapping[str, Any], root: Mapping[str, Any], path: str, depth: int) -> Iterator[tuple[str, str, str]]:
    """Yield path, type and meaning of each key below a schema."""
    required = set(schema.get("required", ()))
    members = [(f"{path}.{name}".lstrip("."), name, inner) for name, inner in schema.get("properties", {}).items()]
    if isinstance(schema.get("additionalProperties"), Mapping):
        members.append((f"{path}.{{}}", "", schema["additionalProperties"]))
    for where, name, written in members:
        inner = _followed(written, root)
        optional = "" if name in required or not name else " (optional)"
        yield where, _kind(inner) + optional, _text(written.get("description") or inner.get("description", ""))
        if depth < _DEEPEST:
            yield from _keys(inner, root, where, depth + 1)
            if isinstance(inner.get("items"), Mapping):
                yield from _keys(_followed(inner["items"], root), root, f"{where}[]", depth + 1)


def _followed(schema: Mapping[str, Any], root: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the schema that a reference leads to, or the schema itself."""
    options = [one for one in schema.get("anyOf", schema.get("oneOf", ())) if one.get("type") != "null"]
    if "$ref" not in schema and options:
        return _followed(options[0], root)
    if "$ref" not in schema:
        return schema
    found: Any = root
    for step in schema["$ref"].removeprefix("#/").split("/"):
        found = found[step]
    return _followed(found, root)


def _kind(schema: Mapping[str, Any]) -> str:
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    kind = schema.get("type", "any")
    return kind if isinstance(kind, str) else " or ".join(kind)


def _text(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "\\<").replace("*", "\\*").replace("\n", " ")
