"""Compare two descriptions of an API: what breaks clients of the older one, and what else changed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from conformance.documents.json_schema import Schema
from conformance.documents.openapi import Operation, read_operations
from conformance.documents.parameters import Parameter
from conformance.documents.resources import PARAMETER
from conformance.documents.schema_compatibility import schema_changes

_KINDS: Final = {"query": "query parameter", "header": "header", "cookie": "cookie", "path": "path parameter"}


@dataclass(frozen=True)
class Change:
    """A change of a description.

    Attributes:
        breaking: whether a client of the older description may fail.
        operation: method and path, or the whole if empty.
        text: what changed.
    """

    breaking: bool
    operation: str
    text: str


def changes(old: Schema, new: Schema) -> list[Change]:
    """Return what changed between two OpenAPI 3 documents, those that break clients first.

    Raises:
        UnresolvedError, AttributeError, TypeError, KeyError: a document is malformed.
    """
    before, after = _by_request(old), _by_request(new)
    gone = [item.label for key, item in before.items() if key not in after]
    added = [item.label for key, item in after.items() if key not in before]
    found = [Change(breaking=True, operation=label, text="the operation is gone") for label in gone]
    found += [Change(breaking=False, operation=label, text="the operation is new") for label in added]
    for key, item in before.items():
        if key in after:
            found += [Change(breaking, item.label, text) for breaking, text in _of_operation(item, after[key])]
    return sorted(dict.fromkeys(found), key=lambda change: not change.breaking)


def _by_request(document: Schema) -> dict[tuple[str, str], Operation]:
    """Return the operations by method and path below the server, in which the names of parameters do not count."""
    servers = document.get("servers")
    base = urlsplit(str(servers[0].get("url", ""))).path.rstrip("/") if servers else ""
    return {
        (item.method, base + PARAMETER.sub("{}", item.template)): item
        for item in read_operations(document, closed=True)
    }


def _of_operation(old: Operation, new: Operation) -> Iterator[tuple[bool, str]]:
    yield from _security(old, new)
    yield from _parameters(old, new)
    yield from _body(old, new)
    yield from _responses(old, new)


def _security(old: Operation, new: Operation) -> Iterator[tuple[bool, str]]:
    before, after = (item.security or ((),) for item in (old, new))
    if {frozenset(one) for one in before} == {frozenset(one) for one in after}:
        return
    # Who has what sufficed before must be let in.
    breaking = any(not any(set(needed) <= set(had) for needed in after) for had in before)
    yield breaking, f"needs {_schemes(after)}, before {_schemes(before)}"


def _schemes(alternatives: tuple[tuple[str, ...], ...]) -> str:
    return " or ".join(" with ".join(one) or "no credentials" for one in alternatives)


def _parameters(old: Operation, new: Operation) -> Iterator[tuple[bool, str]]:
    before, after = _by_name(old), _by_name(new)
    for key, one in after.items():
        if key not in before:
            word = "new, and required" if one.required else "new"
            yield one.required, f"{_called(one)} is {word}"
    for key, one in before.items():
        other = after.get(key)
        if other is None:
            yield True, f"{_called(one)} is gone"
            continue
        if one.required != other.required:
            yield other.required, f"{_called(one)} is {'required' if other.required else 'optional'} now"
        if (one.style, one.explode) != (other.style, other.explode):
            yield True, f"{_called(one)} is written in another way (style or explode)"
        for breaking, text in schema_changes(one.schema, other.schema, request=True):
            yield breaking, f"{_called(one)}{text}"


def _by_name(operation: Operation) -> dict[tuple[str, str], Parameter]:
    """Return the parameters: those of the path by their place in it, those of the header in any case."""
    places = {name: str(number) for number, name in enumerate(PARAMETER.findall(operation.template))}
    found = {}
    for one in operation.parameters:
        name = places.get(one.name, one.name) if one.where == "path" else one.name
        found[one.where, name.lower() if one.where == "header" else name] = one
    return found


def _called(parameter: Parameter) -> str:
    return f"{_KINDS.get(parameter.where, parameter.where)} {parameter.name}"


def _body(old: Operation, new: Operation) -> Iterator[tuple[bool, str]]:
    if old.bodies and not new.bodies:
        yield True, "takes no body any more"
        return
    if not old.bodies:
        if new.bodies:
            yield new.body_required, f"takes a body{', which is required' if new.body_required else ''}"
        return
    if old.body_required != new.body_required:
        yield new.body_required, f"the body is {'required' if new.body_required else 'optional'} now"
    before, after = ({name: body.schema for name, body in item.bodies.items()} for item in (old, new))
    yield from _contents("the body", before, after, request=True)


def _responses(old: Operation, new: Operation) -> Iterator[tuple[bool, str]]:
    for status, content in old.responses.items():
        key = status if status in new.responses else _covering(status, new)
        if key is None:
            yield True, f"status {status} is gone"
            continue
        yield from _contents(f"response {status}", content, new.responses[key], request=False)
        yield from _headers(status, old.headers.get(status, {}), new.headers.get(key, {}))
    for status in new.responses:
        if status not in old.responses:
            yield False, f"status {status} is new"


def _covering(status: str, operation: Operation) -> str | None:
    return operation.response_key(int(status)) if status.isdigit() else None


def _headers(
    status: str, old: dict[str, tuple[bool, Schema]], new: dict[str, tuple[bool, Schema]]
) -> Iterator[tuple[bool, str]]:
    for name, (required, schema) in old.items():
        if name not in new:
            yield True, f"response {status}, header {name} is gone"
            continue
        if required and not new[name][0]:
            yield True, f"response {status}, header {name} is optional now"
        for breaking, text in schema_changes(schema, new[name][1], request=False):
            yield breaking, f"response {status}, header {name}{text}"
    for name in new:
        if name not in old:
            yield False, f"response {status}, header {name} is new"


def _contents(
    what: str, old: dict[str, Schema], new: dict[str, Schema], *, request: bool
) -> Iterator[tuple[bool, str]]:
    """Yield what changed in the media types of a body, and in the schema of each."""
    told: set[tuple[bool, str]] = set()
    for name, schema in old.items():
        other = new.get(name, next((new[one] for one in (f"{name.partition('/')[0]}/*", "*/*") if one in new), None))
        if other is None:
            yield True, f"{what} is no longer {name}"
            continue
        for breaking, text in schema_changes(schema, other, request=request):
            if (breaking, text) not in told:
                told.add((breaking, text))
                yield breaking, f"{what}{text}"
    for name in new:
        if name not in old and (old or not request):
            # A response that had no content may have one: a client that expects none need not look at it.
            yield False, f"{what} may be {name}"
