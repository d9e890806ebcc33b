"""Compare two descriptions of an API: what breaks clients of the older one, and what else changed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from conformance.documents.json_schema import Schema
from conformance.documents.openapi import methods_of
from conformance.documents.operation_compatibility import Described, Documents, Found, operation_changes
from conformance.documents.resources import PARAMETER
from conformance.documents.security_compatibility import security_changes

_VARIABLE: Final = re.compile(r"\{([^{}]+)\}")
# An operation below one of its servers, by what a client sends.
_Key = tuple[str, str]


@dataclass(frozen=True)
class Change:
    """A change of a description.

    Attributes:
        breaking: whether a client of the older description may fail; None if it is not known.
        operation: method and path, or the whole if empty.
        text: what changed.
    """

    breaking: bool | None
    operation: str
    text: str


def changes(old: Schema, new: Schema) -> list[Change]:
    """Return what changed between two OpenAPI 3 documents: what breaks clients, what may, and the rest.

    Raises:
        UnresolvedError, AttributeError, TypeError, KeyError: a document is malformed.
    """
    both = Documents(old, new)
    found = list(_of_operations(both, *(_operations(document, "paths") for document in (old, new))))
    webhooks = [_operations(document, "webhooks") for document in (old, new)]
    found += _of_operations(both, *webhooks, by_client=False)
    order = {True: 0, None: 1, False: 2}
    return sorted(dict.fromkeys(found), key=lambda change: order[change.breaking])


def _of_operations(
    both: Documents, before: dict[_Key, Described], after: dict[_Key, Described], *, by_client: bool = True
) -> Iterator[Change]:
    what = "operation" if by_client else "message"
    for key, item in before.items():
        if key not in after:
            yield Change(breaking=True, operation=_label(key, item), text=f"the {what} is gone")
    known = {id(item.operation) for key, item in after.items() if key in before}
    for key, item in after.items():
        if id(item.operation) not in known:
            yield Change(breaking=False, operation=_label(key, item), text=f"the {what} is new")
    compared = set()
    for key, item in before.items():
        other = after.get(key)
        if other is not None and (id(item.operation), id(other.operation)) not in compared:
            compared.add((id(item.operation), id(other.operation)))
            for breaks, text in _of_operation(both, item, other, by_client=by_client):
                yield Change(breaks, _label(key, item), text)


def _label(key: _Key, item: Described) -> str:
    return f"{key[0]} {item.path}"


def _of_operation(both: Documents, old: Described, new: Described, *, by_client: bool) -> Iterator[Found]:
    if by_client:
        yield from security_changes((both.old, old.operation), (both.new, new.operation))
    yield from operation_changes(both, old, new, by_client=by_client)
    # What the API calls in the other direction.
    callbacks = _callbacks(old), _callbacks(new)
    for change in _of_operations(both, *callbacks, by_client=not by_client):
        yield change.breaking, f"callback {change.operation}: {change.text}"


def _operations(document: Schema, section: str) -> dict[_Key, Described]:
    """Return the operations by method and path below each server, in which the names of parameters do not count."""
    whole = Described(document, "", {}, {})
    found: dict[_Key, Described] = {}
    for path, given in (document.get(section) or {}).items():
        if not isinstance(given, dict):
            raise TypeError(f"the path {path} has no object")
        item = whole.followed(given)
        for method, operation in methods_of(item).items():
            servers = operation.get("servers") or item.get("servers") or document.get("servers")
            bases = [_base(server) for server in servers or [Schema()]] if section == "paths" else [""]
            for base in bases:
                found[method, base + PARAMETER.sub("{}", path)] = Described(document, path, item, operation)
    return found


def _callbacks(described: Described) -> dict[_Key, Described]:
    return {
        (method, str(expression)): Described(described.document, str(expression), item, operation)
        for callback in described.operation.get("callbacks", {}).values()
        for expression, given in described.followed(callback).items()
        if not str(expression).startswith("x-")
        for item in (described.followed(given),)
        for method, operation in methods_of(item).items()
    }


def _base(server: Schema) -> str:
    """Return the path of a server's URL, with the defaults of its variables."""
    variables = server.get("variables", {})
    url = _VARIABLE.sub(lambda found: str(variables.get(found[1], {}).get("default", "")), str(server.get("url", "")))
    return urlsplit(url).path.rstrip("/")
