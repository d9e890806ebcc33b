"""Values for the parameters and bodies of an operation: described, given by the user, or seen in earlier responses."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any
from urllib.parse import unquote, urlsplit

from conformance.api.rest.listing import listing_of, page_of
from conformance.api.rest.references import in_link, refers, singular, thing_of, values_in
from conformance.api.rest.samples import backwards, entry_of, fits, sample
from conformance.api.rest.unique import Unique
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import Parameter, plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import text_of
from conformance.transport.exchange import Exchange, Outgoing

_REMEMBERED = 16  # values that are remembered for each name
_TRIED = 4  # remembered values that are tried in one place
_DEPTH = 6
#: Usual members that identify an item of a collection.
IDS = ("id", "uuid", "name", "key", "slug")


class Values:
    """The values that a run knows.

    Args:
        given: values by the name of a parameter or member, from the user.
        collections: names of the collections that the API has, in the singular.

    Attributes:
        unique: what is known of the members that must be new.
    """

    def __init__(
        self, given: Mapping[str, Sequence[Any]] | None = None, collections: frozenset[str] = frozenset()
    ) -> None:
        self.collections = collections
        self.unique = Unique(collections)
        self._accepted: dict[tuple[str, bool], set[str]] = defaultdict(set)
        self._given = {plain_name(name): list(values) for name, values in (given or {}).items()}
        self._seen: dict[str, list[Any]] = defaultdict(list)
        self._ids: dict[str, list[Any]] = defaultdict(list)
        # Ids of what was deleted, and of what the run has created, the newest first, by collection.
        self._gone: dict[str, set[str]] = defaultdict(set)
        self._made: dict[str, list[Any]] = defaultdict(list)

    def learn(self, operation: Operation, exchange: Exchange) -> None:
        """Remember the scalars of a successful response by name, and the ids in it but that of a deleted thing."""
        response = exchange.response
        if response.ok:
            self._note_deletion(operation, exchange)
        location = (response.header("location") or "").split("?", 1)[0].rstrip("/")
        if response.ok and location:
            self._learn_id(operation, location.rsplit("/", 1)[-1])
        for link in re.findall(r"<([^>]*)>", response.header("link") or ""):
            self._learn_link(link)
        if not response.ok or not is_json(response.media_type):
            return
        value = read_json(response.body).value
        self._learn(value, 0)
        page = page_of(response, operation) if listing_of(operation) is not None else None
        items = page.items if page is not None else value if isinstance(value, list) else [value]
        items = [*value] if isinstance(value, dict) and "object" in kinds_of(entry_of(operation.shape) or {}) else items
        for item in items[:_REMEMBERED]:
            if isinstance(item, dict):
                for name in IDS:
                    if isinstance(item.get(name), str | int):
                        self._learn_id(operation, item[name])
                        break
            elif isinstance(item, str | int) and isinstance(value, list | dict):
                self._learn_id(operation, item)

    def _note_deletion(self, operation: Operation, exchange: Exchange) -> None:
        """Remember whether a thing exists, and whether PUT has created it (RFC 9110 9.3.4)."""
        above, _, last = operation.template.rstrip("/").rpartition("/")
        text = unquote(urlsplit(exchange.request.url).path.rstrip("/").rpartition("/")[2])
        if last.startswith("{") and operation.method == "DELETE":
            for known in (self._ids, self._made):
                known[above] = [one for one in known[above] if text_of(one) != text]
            self._gone[above].add(text)
        elif last.startswith("{"):
            self._gone[above].discard(text)
            if operation.method == "PUT" and exchange.response.status == HTTPStatus.CREATED:
                for known in (self._ids, self._made):
                    self._remember(known[above], text)

    def _learn_id(self, operation: Operation, id_: Any) -> None:
        """Remember the id of a thing in the collection of an operation."""
        for known in (self._ids, self._made) if operation.method == "POST" else (self._ids,):
            self._remember(known[operation.template.rstrip("/")], id_)

    def _learn(self, value: Any, depth: int) -> None:
        if depth > _DEPTH:
            return
        if isinstance(value, dict):
            for name, item in value.items():
                if isinstance(item, str | int | float) and not isinstance(item, bool) and item != "":
                    self._remember(self._seen[plain_name(name)], item)
                    self._learn_link(str(item))
                self._learn(item, depth + 1)
        elif isinstance(value, list):
            for item in value[:_REMEMBERED]:
                self._learn(item, depth + 1)

    def _learn_link(self, text: str) -> None:
        """Remember the values in a link, such as the cursor of the next page."""
        for name, value in in_link(text):
            self._remember(self._seen[plain_name(name)], value)

    def remember(self, operation: Operation, request: Outgoing) -> None:
        """Remember the values of a request that the device accepted."""
        for name, _, text in values_in(operation, request) if request.method == operation.method else ():
            self._accepted[plain_name(name), operation.safe].add(text)

    def invents(self, operation: Operation, request: Outgoing) -> bool:
        """Return whether a request refers to something that the device has not named so far."""
        return any(
            refers(name, schema, self.collections) and not self._is_known(operation, name, schema, text)
            for name, schema, text in values_in(operation, request)
        )

    def _is_known(self, operation: Operation, name: str, schema: Schema, text: str) -> bool:
        plain = plain_name(name)
        known = [*self.references(operation, name, schema), *self._given.get(plain, [])]
        # A read accepts a filter by a thing that does not exist.
        accepted = self._accepted[plain, False] | (self._accepted[plain, True] if operation.safe else set())
        return text in accepted or text in map(text_of, known)

    def references(self, operation: Operation, name: str, schema: Schema) -> list[Any]:
        """Return values for a reference of this name from earlier responses, the likeliest first."""
        items = flat(schema).get("items") if "array" in kinds_of(schema) else None
        schema = items if isinstance(items, dict) else schema
        plain, thing = plain_name(name), thing_of(name)
        own = operation.template.split("/{", 1)[0].rstrip("/")
        by_name = [value for key, values in self._seen.items() if key == plain for value in values]
        by_end = [v for key, values in self._seen.items() if key != plain and key.endswith(plain) for v in values]
        by_thing = [
            value
            for template, values in self._ids.items()
            if thing and singular(_last(template)) == thing
            for value in values
        ]
        by_own = self._ids.get(own, []) if plain.endswith(("id", "uuid", "parent")) else []
        gone = {text for above, texts in self._gone.items() if thing == singular(_last(above)) for text in texts}
        found = _distinct([*by_name, *by_thing, *by_end, *by_own])
        return [value for value in found if fits(schema, value) and text_of(value) not in gone]

    @staticmethod
    def _remember(known: list[Any], value: Any) -> None:
        # Newest first: a thing that an older value names may be deleted.
        if value in known:
            known.remove(value)
        known.insert(0, value)
        del known[_REMEMBERED:]

    def known_ids(self, operation: Operation, parameter: Parameter) -> list[Any]:
        """Return values of a parameter that an earlier response named."""
        before = operation.template.split(f"{{{parameter.name}}}", 1)[0].rstrip("/")
        return [*self._of(self._ids, before), *self._seen.get(plain_name(parameter.name), ())]

    @staticmethod
    def _of(known: Mapping[str, list[Any]], above: str) -> list[Any]:
        """Return the ids of a collection; last, of one with its name below another thing, where they may be made."""
        others = [name for name in known if name != above and _last(name) == _last(above)]
        return [one for name in (above, *others) for one in known.get(name, ())]

    def of(self, operation: Operation, parameter: Parameter) -> list[Any]:
        """Return values to try for a parameter, the most promising first: at most four that its schema allows."""
        given = self._given.get(plain_name(parameter.name), [])
        named = parameter.where == "path" or plain_name(parameter.name).endswith(IDS)
        learned = self.known_ids(operation, parameter) if named else []
        if parameter.where != "path" and refers(parameter.name, parameter.schema, self.collections):
            learned = self.references(operation, parameter.name, parameter.schema)
            if "array" in kinds_of(parameter.schema):
                learned = [learned[:1]] if learned else []
        # Prefer a sample that is not empty: an empty list or object is written as nothing.
        made = sample(parameter.schema) or sample(parameter.schema, whole=True)
        found = [*given, *parameter.examples, *learned, made]
        if parameter.where == "path":
            above = operation.template.split(f"{{{parameter.name}}}", 1)[0].rstrip("/")
            # A run deletes what it has created, so that other checks still find what was there before.
            is_deleted = operation.method == "DELETE" and operation.template.rstrip("/").endswith("}")
            found = [*given, *(self._of(self._made, above) if is_deleted else ()), *found]
            found.sort(key=lambda value: text_of(value) in self._gone[above])
        return [value for value in _distinct(found) if value in given or fits(parameter.schema, value)][:_TRIED]

    def body(self, schema: Schema, examples: Sequence[Any] = (), operation: Operation | None = None) -> list[Any]:
        """Return bodies to try, the most promising first: the examples, then two made from the schema.

        The first takes the first alternative of each union, the second the last one.
        """
        made = [self.fill(sample(item), item, operation) for item in (schema, backwards(schema))]
        return _distinct([*(value for value in examples if not isinstance(value, str)), *made])[:_TRIED]

    def fill(self, value: Any, schema: Schema, operation: Operation | None = None) -> Any:
        """Return an object whose members have the values that the user gave, or that a response named."""
        if isinstance(value, list):
            items = flat(schema).get("items")
            return [self.fill(item, items if isinstance(items, dict) else {}, operation) for item in value]
        if not isinstance(value, dict):
            return value
        properties = flat(schema).get("properties", {})
        return {name: self._member(name, item, properties.get(name, {}), operation) for name, item in value.items()}

    def _member(self, name: str, item: Any, schema: Schema, operation: Operation | None) -> Any:
        given = [one for one in self._given.get(plain_name(name), []) if fits(schema, one)]
        if given:
            return given[0]
        # Only identifiers: values of another member with the same name may not fit here.
        if operation is None or not refers(name, schema, self.collections):
            return self.fill(item, schema, operation)
        known = self.references(operation, name, schema)
        if isinstance(item, list):
            return known[: len(item)] if len(known) >= len(item) else item
        return known[0] if known else self.fill(item, schema, operation)


def _last(template: str) -> str:
    return template.rpartition("/")[2]


def _distinct(values: Sequence[Any]) -> list[Any]:
    found: list[Any] = []
    for value in values:
        if not any(value == item and type(value) is type(item) for item in found):
            found.append(value)
    return found
