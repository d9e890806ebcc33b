"""Find operations whose requests contain a ROS name: in the path, in a query parameter, or in a member of the body."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
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
# Operations that are read for the values of others' parameters.
_MOST_READ: Final = 500


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


def named_in_paths(
    operations: Sequence[Operation], ends: dict[str, Any], get: Callable[[Operation], Any]
) -> Iterator[tuple[Operation, str]]:
    """Yield operations with the values that lists give to the parameters of their paths, and the ROS name of each."""
    left = [(one.template, one, "") for one in operations if "{" not in one.template]
    for template, operation, _ in left:
        value = get(operation) if len(left) < _MOST_READ else None
        lists = [value, *(value.values() if isinstance(value, dict) else ())]
        for item in (item for found in lists if isinstance(found, list) for item in found if isinstance(item, dict)):
            texts = [text for text in item.values() if isinstance(text, str)]
            name = next((text for text in texts if text in ends), "")
            for other in operations:
                parameter, end, rest = other.template.removeprefix(f"{template}/{{").partition("}")
                id_ = next((item[key] for key in (parameter, "id", "name") if isinstance(item.get(key), str)), "")
                if end and id_ and other.template.startswith(f"{template}/{{"):
                    made = replace(other, template=f"{operation.template}/{quote(id_, safe='')}{rest}")
                    way = {"GET": "subscribers"}.get(made.method, "publishers")
                    if "{" not in rest:
                        left.append((other.template, made, name))
                    if name and (rest or way not in ends[name] or ends[name][way]):
                        yield made, name


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
