"""Remember the ids of everything that a run may have moved, because a stop must name each of them."""

import re
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice, product
from typing import Any, Final
from urllib.parse import unquote

from conformance.api.rest.samples import fits
from conformance.contract.pack import Contract
from conformance.documents.json_text import read_json
from conformance.documents.openapi import PARAMETER, Operation, matching, operations_of
from conformance.documents.parameter_reading import decoded_query, pairs_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.transport.exchange import SAFE_METHODS, Exchange, Listener

_MOST: Final = 64  # most remembered values of one parameter, and most requests of a stop with parameters
_REFUSED: Final = range(400, 500)  # statuses of a refused request
# Values that the device refused and that are remembered, for each parameter.
_MOST_REFUSED: Final = 8


class Driven(Listener):
    """The values in the requests that may have moved the device, by the names that its stops have for them.

    A value counts from before its request is sent until a response with 4xx says that nothing was moved by it. As a
    broken device moves all the same, the newest of these values are named to the stops as well, after the others.

    Args:
        contract: the description.
        base_url: URL below which the operations are.
    """

    def __init__(self, contract: Contract, base_url: str) -> None:
        self._contract, self._base_url = contract, base_url
        #: How many requests may have moved the device since it was last stopped.
        self.moves = 0
        #: Requests to move that the device has refused since then: a faulty device may have moved all the same.
        self.refused = 0
        stops = [operation for operation in operations_of(contract) if operation.stop]
        # A stop without a parameter stops everything that moves, if there is no other stop.
        self._stops_all = len(stops) == 1 and not [*_places(stops[0])]
        self._names = {name for stop in stops for names, _, _ in _places(stop) for name in names}
        # Whether a response has shown that the device accepts the value, by parameter and value.
        self._values: dict[str, dict[Any, bool]] = defaultdict(dict)
        self._refused: dict[str, dict[Any, None]] = defaultdict(dict)

    def sends(self, method: str, url: str) -> None:
        """Note the values in a request that is sent now."""
        self.moves += self._may_move(method, self._operation_of(method, url))
        self._note(method, url, b"", taken=False)

    @staticmethod
    def _may_move(method: str, operation: Operation | None) -> bool:
        if operation is None:
            return method not in SAFE_METHODS
        return operation.motion or (method not in SAFE_METHODS and not (operation.stop or operation.reads))

    def _operation_of(self, method: str, url: str) -> Operation | None:
        path = url.removeprefix(self._base_url).partition("?")[0]
        return matching(self._contract, method, path) if url.startswith(self._base_url) else None

    def on_response(self, exchange: Exchange) -> None:
        """Keep the values of a request, or forget them if the device refused it."""
        request = exchange.request
        called = self._operation_of(request.method, request.url)
        if called is not None and called.stop and exchange.response.ok and self._stops_all:
            self.moves = self.refused = 0
        elif exchange.response.status in _REFUSED and self.moves and self._may_move(request.method, called):
            self.moves -= 1
            self.refused += 1
        if exchange.response.status not in _REFUSED:
            self._note(request.method, request.url, request.body, taken=True)
            return
        for name, value in self._ids_in(request.method, request.url, request.body):
            if self._values[name].get(value) is False:
                del self._values[name][value]
            refused = self._refused[name]
            refused.pop(value, None)
            refused[value] = None
            if len(refused) > _MOST_REFUSED:
                del refused[next(iter(refused))]

    def _note(self, method: str, url: str, body: bytes, *, taken: bool) -> None:
        for name, value in self._ids_in(method, url, body):
            known = self._values[name]
            known[value] = known.pop(value, False) or taken
            if len(known) > _MOST:
                del known[next((one for one, is_taken in known.items() if not is_taken), next(iter(known)))]

    def _ids_in(self, method: str, url: str, body: bytes) -> Iterator[tuple[str, Any]]:
        """Yield name and value of each id in a request that a stop also takes; nothing for a stop itself."""
        if not self._names or method in SAFE_METHODS or not url.startswith(self._base_url):
            return
        path, _, query = url[len(self._base_url) :].partition("?")
        operation = matching(self._contract, method, path)
        if operation is None or operation.stop:
            return
        literal = PARAMETER.split(operation.template)[::2]
        found = re.fullmatch("([^/]*)".join(map(re.escape, literal)), path)
        named: list[tuple[str, Any]] = []
        for names, text in zip(_path_names(operation.template), found.groups() if found else (), strict=False):
            named += [(name, unquote(text)) for name in names]
        with suppress(ValueError):
            named += [(plain_name(name), decoded_query(text)) for name, text in pairs_of(query)]
        value = read_json(body).value if body else None
        if isinstance(value, dict):
            named += [(plain_name(name), one) for name, one in value.items() if isinstance(one, str | int)]
        yield from ((name, one) for name, one in named if name in self._names)

    def named_by(self, stop: Operation, *, refused: bool = False) -> list[list[tuple[str, str, Any]]]:
        """Return for all that the run may have moved by which values a stop names it, the newest first.

        A value is given with its place and its name there: path, query or body. The list is empty if the stop names
        nothing that was moved. It may have values that the device refused, if these are asked for.
        """
        known = []
        for names, schema, (where, called) in _places(stop):
            texts = (
                text for name in names for text in (*self._values[name], *(self._refused[name] if refused else ()))
            )
            values = dict.fromkeys(value for text in texts for value in _fitting(schema, text))
            if values:
                known.append([(where, called, value) for value in reversed(values)])
        return [list(chosen) for chosen in islice(product(*known), _MOST)] if known else []


def _path_names(template: str) -> list[tuple[str, str]]:
    """Return for each path parameter its normalised name and the segment before it: /arms/{id} is /arms/{arm}."""
    return [(plain_name(found[1]), template[: found.start()]) for found in PARAMETER.finditer(template)]


def _places(stop: Operation) -> Iterator[tuple[tuple[str, ...], Any, tuple[str, str]]]:
    """Yield name, schema and place of each value with which a stop names the part to stop."""
    before = dict(_path_names(stop.template))
    for item in stop.parameters:
        if item.where == "path" or (item.where == "query" and item.required):
            name = plain_name(item.name)
            names = (name, before[name]) if item.where == "path" and name in before else (name,)
            yield names, item.schema, (item.where, item.name)
    for body in list(stop.bodies.values())[:1]:
        schema = flat(body.schema)
        for name in schema.get("required", ()):
            member = schema.get("properties", {}).get(name, {})
            yield (plain_name(name),), member, ("body", name)


def _fitting(schema: Any, text: Any) -> Iterator[Any]:
    """Yield a value as a schema allows it: a number may have been the text of a path."""
    for value in (text, read_json(text.encode("utf-8", "replace")).value if isinstance(text, str) else str(text)):
        if isinstance(value, str | int) and not isinstance(value, bool) and fits(schema, value):
            yield value
            return
