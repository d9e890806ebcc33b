"""A motion map as TOML on lines of its own, as a person writes and reads it."""

from __future__ import annotations

import re
from typing import Any, Final

from conformance.contract.toml_file import basic_string as string

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
