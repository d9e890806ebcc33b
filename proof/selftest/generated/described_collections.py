"""Mutants of the lists of a described device, and of the items in them.

A parameter of a list has no effect, or a total goes wrong in time. A request to one item reaches another, or a refused
one is performed.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qsl, quote, unquote, urlencode

from conformance.api.rest.listing import COUNTS, TOTALS, Page, listing_of, page_of
from conformance.api.rest.things import collection_of
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import Parameter, plain_name
from conformance.documents.representation import flat
from conformance.transport import exchange as transport
from proof.mutation.messages import Change, Forward, Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.generated.places import Exchange

#: Stands for a missing value.
NOTHING = object()
_INPUT_DEPTH = 3
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class Input:
    """A parameter or member of a body.

    Attributes:
        where: path, query or body.
        steps: its name, after those of the objects that hold it.
        schema: the schema of its value, flattened.
        required: whether requests must have it.
    """

    where: str
    steps: tuple[str, ...]
    schema: Schema
    required: bool

    @property
    def label(self) -> str:
        """Return its part of a mutant's name."""
        return f"{self.where}.{'.'.join(self.steps)}"

    def read(self, exchange: Exchange, request: Request) -> Any:
        """Return the value in a request as its schema has it; NOTHING where it is not there or cannot be read."""
        if self.where == "body":
            holder = self._holder(_body(request))
            return holder.get(self.steps[-1], NOTHING) if holder is not None else NOTHING
        text = self._texts(exchange, request).get(self.steps[0])
        return NOTHING if text is None else _value(self.schema, text)

    def write(self, exchange: Exchange, request: Request, value: Any) -> Request:
        """Return the request with another value; NOTHING leaves it out."""
        if self.where == "body":
            whole = _body(request)
            holder = self._holder(whole)
            if holder is not None:
                holder.pop(self.steps[-1], None)
                if value is not NOTHING:
                    holder[self.steps[-1]] = value
            return request.copy(body=json.dumps(whole).encode())
        text = value if isinstance(value, str) else "" if value is NOTHING else json.dumps(value)
        if self.where == "query":
            pairs = [
                (key, item) for key, item in parse_qsl(request.query, keep_blank_values=True) if key != self.steps[0]
            ]
            pairs += [(self.steps[0], text)] if value is not NOTHING else []
            return request.copy(target=request.path + (f"?{urlencode(pairs)}" if pairs else ""))
        found = re.fullmatch(exchange.path, request.path)
        number = exchange.parameters.index(self.steps[0]) + 1
        if found is None or value is NOTHING:
            return request
        path = request.path[: found.start(number)] + quote(text, safe="") + request.path[found.end(number) :]
        return request.copy(target=path + (f"?{request.query}" if request.query else ""))

    def there(self, request: Request) -> bool:
        """Return whether the object that holds it is in a request."""
        return self.where != "body" or self._holder(_body(request)) is not None

    def _holder(self, value: Any) -> dict[str, Any] | None:
        for step in self.steps[:-1]:
            value = value.get(step) if isinstance(value, dict) else None
        return value if isinstance(value, dict) else None

    def _texts(self, exchange: Exchange, request: Request) -> dict[str, str]:
        if self.where == "query":
            return dict(parse_qsl(request.query, keep_blank_values=True))
        found = re.fullmatch(exchange.path, request.path)
        return {
            name: unquote(text)
            for name, text in zip(exchange.parameters, found.groups() if found else (), strict=False)
        }


def _body(request: Request) -> Any:
    try:
        return json.loads(request.body) if request.media_type.endswith("json") else None
    except (ValueError, RecursionError):
        return None


def _value(schema: Schema, text: str) -> Any:
    """Return the value of a parameter's text."""
    kinds = kinds_of(schema)
    if kinds & {"integer", "number"} and _NUMBER.fullmatch(text):
        number = float(text)
        return int(text) if text.lstrip("-").isdigit() else number
    if "boolean" in kinds and text in {"true", "false"}:
        return text == "true"
    return text


def inputs_of(operation: Operation) -> Iterator[Input]:
    """Yield the parameters in path and query that are scalars, and the members of a JSON body."""
    for item in operation.parameters:
        kinds = kinds_of(item.schema)
        if item.where in {"path", "query"} and kinds and not kinds & {"object", "array"}:
            yield Input(item.where, (item.name,), flat(item.schema), item.required)
    for name, body in operation.bodies.items():
        if is_json(name):
            yield from _members(body.schema, ())
            return


def _members(schema: Schema, steps: tuple[str, ...]) -> Iterator[Input]:
    schema = flat(schema)
    for name, part in schema.get("properties", {}).items():
        flatter = flat(part)
        if not flatter.get("readOnly"):
            yield Input("body", (*steps, name), flatter, name in schema.get("required", ()))
            if kinds_of(flatter) == {"object"} and len(steps) < _INPUT_DEPTH:
                yield from _members(flatter, (*steps, name))


_RIGHT = 10  # number of right lists, after which the mutant's total is always wrong
_DEPTH = 2  # depth of nested members
_Differs = Callable[[Page, Page], bool]
_SUCCESS, _REFUSED, _NO_TYPE = range(200, 300), range(400, 500), 415
# Function by which a mutant handles a request to an item, from request, response, another item and a way to the device.
_Act = Callable[[Request, Response, str, Forward], Response | None]


def of_lists(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants of an operation's list that ignore its parameters or miscount its totals."""
    listing = listing_of(operation)
    if listing is None:
        return
    rows: list[tuple[str, Parameter | None, _Differs]] = [
        ("limit-ignored", listing.limit, lambda right, wrong: len(wrong.items) > len(right.items)),
        ("order-ignored", listing.sort, _in_another_order),
        *(("filter-ignored", one, _with_more) for one in listing.filters.values()),
        *(("page-repeated", one, _with_more) for one in (listing.offset, listing.page, listing.cursor)),
    ]
    for operator, parameter, differs in rows:
        if parameter is not None:
            says = f"{exchange.name} answers as if {parameter.name} was not sent."
            make = _ignoring(exchange, parameter, differs)
            yield GeneratedMutant.of(operator, exchange, f"query.{parameter.name}", says, make)
    if _tells_total(operation.shape or {}):
        says = f"{exchange.name} tells one item too many after {_RIGHT} lists."
        yield GeneratedMutant.of("total-later", exchange, "answer", says, _counting(exchange))


def _tells_total(schema: Schema, depth: int = 0) -> bool:
    """Return whether a response has a member that tells how many items there are, in an object around the list."""
    parts = flat(schema).get("properties", {}) if depth <= _DEPTH else {}
    return any(plain_name(name) in TOTALS | COUNTS or _tells_total(part, depth + 1) for name, part in parts.items())


def _with_more(right: Page, wrong: Page) -> bool:
    return bool(set(wrong.identities) - set(right.identities))


def _in_another_order(right: Page, wrong: Page) -> bool:
    return right.identities != wrong.identities and sorted(right.identities) == sorted(wrong.identities)


def _ignoring(exchange: Exchange, parameter: Parameter, differs: _Differs) -> Callable[[Tally], Change]:
    """Return a change that leaves a parameter out, counted where that changes the list."""
    item = Input("query", (parameter.name,), parameter.schema, parameter.required)

    def make(tally: Tally) -> Change:
        def change(request: Request, forward: Forward) -> Response:
            response = forward(request)
            if not exchange.concerns(request) or item.read(exchange, request) is NOTHING:
                return response
            right = _page_in(response)
            other = forward(item.write(exchange, request, NOTHING)) if right is not None else response
            wrong = _page_in(other)
            if right is None or wrong is None or not differs(right, wrong):
                return response
            tally()
            return other

        return change

    return make


def _counting(exchange: Exchange) -> Callable[[Tally], Change]:
    """Return a change that adds one to the totals of later lists."""

    def make(tally: Tally) -> Change:
        seen = 0

        def change(request: Request, forward: Forward) -> Response:
            nonlocal seen
            response = forward(request)
            page = _page_in(response) if exchange.concerns(request) else None
            if page is None or not page.totals:
                return response
            seen += 1
            altered = response.copy()
            if seen <= _RIGHT or not _add_one(altered, page):
                return response
            tally()
            return altered

        return change

    return make


def _add_one(response: Response, page: Page) -> bool:
    """Add one to each total of a body; return whether there is one."""
    value = json.loads(response.body)
    pending, found = [value], False
    while pending:
        inner: Any = pending.pop()
        for name, one in inner.items() if isinstance(inner, dict) else ():
            if plain_name(name) in page.totals and type(one) is int:
                inner[name], found = one + 1, True
            elif isinstance(one, dict):
                pending.append(one)
    response.body = json.dumps(value).encode()
    return found


def _page_in(response: Response) -> Page | None:
    """Return the list in a message, as the checkers read it."""
    return page_of(transport.Response(response.status, tuple(response.fields), response.body, 0.0))


def of_things(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants of an operation of an item, each of which needs another item that was read before."""
    rows: list[tuple[str, str, Callable[[], _Act]]] = []
    if operation.method == "GET":
        rows.append(("another-item", "answers with another item once after each refusal", _another))
    elif operation.method in {"PUT", "PATCH", "DELETE"}:
        rows.append(("reaches-another", "does the same to another item", lambda: _reaching))
    if operation.method in {"PUT", "PATCH"} and any(map(is_json, operation.bodies)):
        rows.append(("applies-refused", "writes what it refuses with 415", lambda: _applying))
    for operator, says, begin in rows if collection_of(operation.template) else ():
        make = _after(exchange, operation, begin)
        yield GeneratedMutant.of(operator, exchange, "item", f"{exchange.name} {says}.", make)


def _after(exchange: Exchange, operation: Operation, begin: Callable[[], _Act]) -> Callable[[Tally], Change]:
    """Return a change that does something after each request to an item, once another item was read."""

    def make(tally: Tally) -> Change:
        read, act = dict[str, None](), begin()

        def change(request: Request, forward: Forward) -> Response:
            response = forward(request)
            if request.side != "rest" or re.fullmatch(exchange.path, request.path) is None:
                return response
            other = next((text for text in reversed(read) if text != request.path), "")
            if request.method == "GET" and response.status in _SUCCESS:
                read.pop(request.path, None)
                read[request.path] = None
            is_own = operation.method in {request.method, "GET"}
            altered = act(request, response, other, forward) if is_own and other else None
            if altered is None:
                return response
            tally()
            return altered

        return change

    return make


def _another() -> _Act:
    waits = [False]

    def act(request: Request, response: Response, other: str, forward: Forward) -> Response | None:
        waits[0] |= response.status in _REFUSED and request.method != "GET"
        if not waits[0] or request.method != "GET" or response.status not in _SUCCESS:
            return None
        waits[0] = False
        found = forward(request.copy(target=other))
        return found if found.status in _SUCCESS and found.body != response.body else None

    return act


def _reaching(request: Request, response: Response, other: str, forward: Forward) -> Response | None:
    if response.status not in _SUCCESS:
        return None
    return response if forward(request.copy(target=other)).status in _SUCCESS else None


def _applying(request: Request, response: Response, _: str, forward: Forward) -> Response | None:
    again = request.copy()
    again.put("Content-Type", "application/json")
    is_refused = response.status == _NO_TYPE and not is_json(request.media_type)
    return response if is_refused and forward(again).status in _SUCCESS else None
