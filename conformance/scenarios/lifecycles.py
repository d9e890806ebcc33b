"""The life of things that an API creates: create one, read it, delete it, read it again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from conformance.api.rest.applicable import allowed
from conformance.api.rest.inputs import usual_inputs, written
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import HELD, held_text
from conformance.api.rest.values import IDS, Values
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, operations_of
from conformance.scenarios.scenario import NotPossibleError, NotSeenError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.reach import is_same, joined, path_of

_CREATED = 201


@dataclass(frozen=True)
class Life:
    """One thing that was created.

    Attributes:
        create, read, delete: labels of the operations; an empty one was not sent.
        created: the POST.
        found: the GET after it.
        deleted: the DELETE, or None.
        gone: the GET after that, or None.
    """

    create: str
    read: str
    created: Exchange
    found: Exchange
    delete: str = ""
    deleted: Exchange | None = None
    gone: Exchange | None = None


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.INPUT)
def lifecycles(api: RestInterface, values: Values) -> tuple[Life, ...]:
    """Create a thing with each POST of a collection, read it, delete it, and read it again."""
    operations = {item.label: item for item in operations_of(api.run.contract) if allowed(api, item)}
    lives, held = [], dict[str, int]()
    for create in operations.values():
        readers = [item for item in operations.values() if item.method == "GET" and _is_item_of(item, create)]
        if create.method == "POST" and readers:
            api.run.limit.check()
            # What was created is deleted.
            with api.run.limit.lifted():
                life = _live(api, values, create, readers[0], operations.get(f"DELETE {readers[0].template}"), held)
            lives += [life] if life is not None else []
    if held and not lives:
        raise NotSeenError(held_text(held, set(held.values())))
    if not lives:
        raise NotPossibleError("no POST that may be called creates a thing that a GET reads")
    return tuple(lives)


def _is_item_of(reader: Operation, create: Operation) -> bool:
    """Return whether an operation reads one item of the collection that another one adds to."""
    rest = reader.template.removeprefix(create.template.rstrip("/"))
    return rest != reader.template and rest.startswith("/{") and rest.endswith("}") and "/" not in rest[1:]


def _live(
    api: RestInterface,
    values: Values,
    create: Operation,
    read: Operation,
    delete: Operation | None,
    held: dict[str, int],
) -> Life | None:
    """Return what became of one thing; None if it was not created, or has no identifier.

    If the device's state did not allow it, the status is noted in ``held``.
    """
    try:
        created = written(create, usual_inputs(create, values)[0]).send(api)
        if created.response.status in HELD:
            held[create.label] = created.response.status
        path = _path_of(created, create, read) if created.response.status == _CREATED else ""
        if not path:
            return None
        found = api.client.send("GET", path)
        if delete is None:
            return Life(create.label, read.label, created, found)
        deleted = api.client.send("DELETE", path)
        gone = api.client.send("GET", path)
    except NoAnswerError:
        return None  # the survey tells what breaks a connection
    return Life(create.label, read.label, created, found, delete.label, deleted, gone)


def _path_of(created: Exchange, create: Operation, read: Operation) -> str:
    """Return the path of a created thing, by its Location or by an identifier in the body."""
    location = created.response.header("location")
    if location:
        target = joined(created.request.url, location)
        below = urlsplit(created.request.url).path.removesuffix(create.template)
        return path_of(target).removeprefix(below) if is_same(target, created.request.url) else ""
    value: Any = read_json(created.response.body).value
    members = value if isinstance(value, dict) else {}
    id_ = next((members[name] for name in IDS if isinstance(members.get(name), str | int)), None)
    parameter = read.parameter("path")[-1].name
    return read.template.replace(f"{{{parameter}}}", str(id_)) if id_ is not None and "{" not in create.template else ""
