"""Apply an OpenAPI Overlay to a description (OAI Overlay Specification 1.0 and 1.1)."""

from __future__ import annotations

import copy
import re
import time
from typing import Any, Final

from conformance.documents.json_schema import Schema

# So many places may the actions of an overlay change, and so many values may they add, in all; and how long, s.
_MOST_PLACES: Final = 50_000
_MOST_NODES: Final = 1_000_000
_MOST_S: Final = 10.0


class OverlayError(ValueError):
    """Raised for an overlay that cannot be applied; the message names the action and the fault."""


def overlaid(document: Schema, overlay: Schema) -> Schema:
    """Return a copy of a description with an overlay's actions applied in their order.

    Raises:
        OverlayError: the overlay is malformed, or an action has no valid JSONPath (RFC 9535).
    """
    # Imported late: it takes a twentieth of a second, and few descriptions have an overlay.
    import jsonpath  # noqa: PLC0415
    from jsonpath.exceptions import JSONPathError  # noqa: PLC0415

    if "overlay" not in overlay or not isinstance(overlay.get("actions"), list):
        raise OverlayError("it is no overlay: it needs 'overlay' and a list of 'actions'")
    changed = copy.deepcopy(document)
    places = nodes = 0
    until = time.monotonic() + _MOST_S
    for number, action in enumerate(overlay["actions"]):
        if not isinstance(action, dict) or not isinstance(action.get("target"), str):
            raise OverlayError(f"actions[{number}] has no 'target'")
        size = _size(action.get("update"))
        try:
            matches = []
            for match in jsonpath.finditer(action["target"], changed):
                places, nodes = places + 1, nodes + size
                if places > _MOST_PLACES or nodes > _MOST_NODES or time.monotonic() > until:
                    limits = f"{_MOST_PLACES:,} places, {_MOST_NODES:,} values and {_MOST_S:g} s"
                    raise OverlayError(f"actions[{number}] goes beyond the limit of an overlay: {limits}")  # noqa: TRY301 - within the loop
                matches.append(match)
        except OverlayError:
            raise
        except (JSONPathError, ValueError, OverflowError, re.error) as error:  # Python reads its numbers and patterns
            raise OverlayError(f"actions[{number}] target {action['target']!r} is no JSONPath: {error}") from error
        # The last first, so that removing an item of a list does not move the next one.
        for match in reversed(matches):
            _apply(changed, list(match.parts), action)
    return changed


def _size(value: Any) -> int:
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + sum(map(_size, parts))


def _apply(document: Schema, parts: list[Any], action: Schema) -> None:
    parent: Any = document
    for part in parts[:-1]:
        parent = parent[part]
    if action.get("remove") is True:
        if parts:
            del parent[parts[-1]]
        return
    update = action.get("update")
    here = parent[parts[-1]] if parts else document
    if isinstance(here, list):
        here.append(copy.deepcopy(update))
    elif isinstance(here, dict) and isinstance(update, dict):
        _merge(here, update)
    elif parts:
        parent[parts[-1]] = copy.deepcopy(update)


def _merge(here: dict[str, Any], update: dict[str, Any]) -> None:
    """Merge an object into another one: objects member by member, lists joined, everything else replaced."""
    for key, value in update.items():
        if isinstance(value, dict) and isinstance(here.get(key), dict):
            _merge(here[key], value)
        elif isinstance(value, list) and isinstance(here.get(key), list):
            here[key] = [*here[key], *copy.deepcopy(value)]
        else:
            here[key] = copy.deepcopy(value)
