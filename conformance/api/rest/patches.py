"""Apply patches to a document: JSON Merge Patch (RFC 7396) and JSON Patch (RFC 6902)."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any, Final

#: Media types of patches; a vendor's own media type may end in the same way.
MERGE: Final = "merge-patch+json"
JSON_PATCH: Final = "json-patch+json"
_MISSING: Final = object()


class PatchError(ValueError):
    """Raised for a JSON patch that must be refused as a whole; the message names the failing operation."""


def merged(document: Any, patch: Any) -> Any:
    """Return a document after a merge patch (RFC 7396 2)."""
    if not isinstance(patch, dict):
        return patch
    found = dict(document) if isinstance(document, dict) else {}
    for name, value in patch.items():
        if value is None:
            found.pop(name, None)
        else:
            found[name] = merged(found.get(name), value)
    return found


def patched(document: Any, operations: Any) -> Any:
    """Return a document after a JSON patch (RFC 6902).

    Raises:
        PatchError: an operation fails, so that all have to be refused (RFC 6902 5; RFC 5789 2).
    """
    found = copy.deepcopy(document)
    for operation in operations if isinstance(operations, list) else ():
        found = _apply(found, operation)
    return found


def partly_patched(document: Any, operations: Any) -> Iterator[Any]:
    """Yield the documents that a device may leave if it applies some operations before it refuses the patch."""
    found = copy.deepcopy(document)
    for operation in operations if isinstance(operations, list) else ():
        try:
            found = _apply(found, operation)
        except PatchError:
            continue
        yield found


def _apply(document: Any, operation: Any) -> Any:
    given = operation if isinstance(operation, dict) else {}
    kind, path, value = given.get("op"), given.get("path"), copy.deepcopy(given.get("value"))
    says = f"{kind} of {path}"
    if not isinstance(path, str) or (kind in {"add", "replace", "test"} and "value" not in given):
        raise PatchError(says)
    if kind == "test":
        if not same(_at(document, path, says), value):
            raise PatchError(says)
        return document
    if kind in {"move", "copy"}:
        origin = given.get("from")
        if not isinstance(origin, str) or path.startswith(f"{origin}/"):
            raise PatchError(says)
        value = copy.deepcopy(_at(document, origin, says))
        document = _with_change(document, origin, _MISSING, says) if kind == "move" else document
    elif kind in {"remove", "replace"}:
        _at(document, path, says)
        if kind == "remove":
            return _with_change(document, path, _MISSING, says)
        return _with_change(document, path, value, says, replaces=True)
    elif kind != "add":
        raise PatchError(says)
    return _with_change(document, path, value, says)


def same(one: Any, other: Any) -> bool:
    """Return whether two JSON values are equal (RFC 6902 4.6): 1 and 1.0 are, 1 and true are not."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[name], other[name]) for name in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    return isinstance(one, bool) is isinstance(other, bool) and bool(one == other)


def shows_new(given: Any, before: dict[str, Any], now: dict[str, Any]) -> bool:
    """Return whether an object shows a member as it was given, which it did not show before."""
    members = given.items() if isinstance(given, dict) else ()
    return any(same(now.get(name), one) and not same(before.get(name), one) for name, one in members)


def _steps(path: str, says: str) -> list[str]:
    """Return the steps of a JSON pointer (RFC 6901)."""
    if path and not path.startswith("/"):
        raise PatchError(says)
    return [text.replace("~1", "/").replace("~0", "~") for text in path.split("/")[1:]]


def _at(document: Any, path: str, says: str) -> Any:
    for step in _steps(path, says):
        if isinstance(document, dict) and step in document:
            document = document[step]
        elif isinstance(document, list) and step.isdecimal() and int(step) < len(document):
            document = document[int(step)]
        else:
            raise PatchError(says)
    return document


def _with_change(document: Any, path: str, value: Any, says: str, *, replaces: bool = False) -> Any:
    """Return a document with a value put, inserted or, if it is _MISSING, removed at a place."""
    steps = _steps(path, says)
    if not steps:
        return None if value is _MISSING else value
    above = _at(document, path.rpartition("/")[0], says)
    last = steps[-1]
    if isinstance(above, dict):
        if value is _MISSING:
            above.pop(last, None)
        else:
            above[last] = value
    elif isinstance(above, list) and (last == "-" or (last.isdecimal() and int(last) <= len(above))):
        index = len(above) if last == "-" else int(last)
        above[index : index + (value is _MISSING or replaces)] = [] if value is _MISSING else [value]
    else:
        raise PatchError(says)
    return document
