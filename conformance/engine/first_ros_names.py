"""Find operations whose requests contain a ROS name: in a query parameter, or in a member of the body."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple
from urllib.parse import quote

from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.openapi import Operation
from conformance.engine.commanded import body_schema, parts_of

_NAME: Final = re.compile(r"(ros_?)?((topic|service|srv|action|server)(_?name)?|name)", re.IGNORECASE)
_TYPE: Final = re.compile(r"((message|msg|topic|service|srv|action|data|interface)_?)?type", re.IGNORECASE)
# Words of a path, an operationId and a parameter that say which kind of name it is; else it is a topic.
_SPOKEN: Final = {"actions": "action|goal", "services": "service|srv|call"}
# Operations that are made of one: a large graph has many names.
_MOST: Final = 20


class Named(NamedTuple):
    """An operation with a ROS name.

    Attributes:
        operation: with the name in its query, or behind "#" if the body has it.
        name: the ROS name.
        body: the members of the body that say it, and its type.
    """

    operation: Operation
    name: str
    body: dict[str, str]


def named_in_requests(operations: Sequence[Operation], ends: Mapping[str, dict[str, str]]) -> Iterator[Named]:
    """Yield each operation whose requests contain a ROS name, with each name.

    Args:
        operations: the description's.
        ends: by "topics", "services" and "actions": types by name.
    """
    for operation in (one for one in operations if "{" not in one.template):
        query = next(
            (one.name for one in operation.parameter("query") if _NAME.fullmatch(one.name) and _is_text(one.schema)), ""
        )
        members = {} if query else _members(body_schema(operation) or {})
        texts = [name for name, schema in members.items() if _is_text(schema)]
        own = next((name for name in texts if _NAME.fullmatch(name)), "")
        words = f"{operation.template} {operation.id} {query} {own}".lower()
        kind = next((kind for kind, spoken in _SPOKEN.items() if re.search(spoken, words)), "topics")
        for name, type_ in list(ends[kind].items())[:_MOST]:
            if query:
                made = f"{operation.template}?{query}={quote(name, safe='/')}"
                yield Named(replace(operation, template=made), name, {})
            elif own:
                body = {own: name} | {member: type_ for member in texts if _TYPE.fullmatch(member)}
                yield Named(replace(operation, template=f"{operation.template}#{name}"), name, body)


def place_of(document: Any, fields: set[str], at: str = "") -> str | None:
    """Return where a document has an object with these fields, and no others; None means nowhere."""
    if not isinstance(document, dict):
        return None
    if fields and document.keys() == fields:
        return at
    places = ((f"{at}/{name.replace('~', '~0').replace('/', '~1')}", one) for name, one in document.items())
    found = (place_of(one, fields, place) for place, one in places)
    return next((place for place in found if place is not None), None)


def _members(schema: Schema) -> dict[str, Schema]:
    return {name: member for part in parts_of(schema) for name, member in part.get("properties", {}).items()}


def _is_text(schema: Schema) -> bool:
    return "string" in kinds_of(schema)
