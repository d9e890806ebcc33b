"""Lists of valves, and the requirements on lists that a run of exchanges with one does not meet."""

import json
from urllib.parse import urlencode

from small_device import answers, contract_of, described

from conformance.checkers.rest import RestCheckers
from conformance.transport.exchange import Exchange, Request, Response

BASE = "http://device:8000"
LIMIT, FILTER, ORDER, TOTAL, PAGES = (
    f"description/list-{name}" for name in ("limit", "filter", "order", "total", "pages")
)
STATES, LEVELS, WAYS = ["open", "closed", "moving"], ["info", "warning", "error"], ["asc", "desc"]
MEMBERS = {
    "id": {"type": "integer"},
    "name": {"type": "string"},
    "zone": {"type": ["string", "null"]},
    "state": {"type": "string", "enum": STATES},
    "level": {"type": "string", "enum": LEVELS},
    "active": {"type": "boolean"},
    "archived": {"type": "boolean"},
    "tags": {"type": "array", "items": {"type": "string", "enum": ["a", "b"]}},
    "opened": {"type": ["string", "null"], "format": "date-time"},
    "size": {"type": "number"},
}
_ITEM = {"type": "object", "properties": MEMBERS}
_NAMES = ("id", "name", "zone", "state", "level", "active", "tags", "size", "opened")
VALVES = [
    dict(zip(_NAMES, row, strict=True))
    for row in (
        (1, "alpha", "north", "open", "info", True, ["a"], 3, "2026-01-02T00:00:00Z"),
        (2, "bravo", "south", "closed", "error", False, ["b"], 1, None),
        (3, "charlie", "north", "moving", "warning", True, ["a", "b"], 2.5, "2026-01-01T00:00:00+02:00"),
        (4, "delta", "south", "open", "info", False, [], 2, "2025-12-01T00:00:00Z"),
    )
]


def whole(name, **schema):
    return {"name": name, "in": "query", "schema": {"type": "integer", **schema}}


def word(name, **schema):
    return {"name": name, "in": "query", "schema": {"type": "string", **schema}}


def boolean(name, **schema):
    return {"name": name, "in": "query", "schema": {"type": "boolean", **schema}}


def _of(value):
    """Return a schema for an envelope whose innermost list has valves."""
    if isinstance(value, list):
        return {"type": "array", "items": _ITEM}
    inner = {name: _of(one) for name, one in value.items() if isinstance(one, dict | list)}
    inner |= {"total_items": {"type": "integer", "description": "How many, whatever the page."}}
    return {"type": "object", "properties": inner}


_JUDGED = ("description/list-", "description/invalid-")


class Seen:
    """The requirements that are not met in a run of exchanges with one list."""

    def __init__(self, tmp_path, parameters, wrapped=lambda items: items, says="", headers=None):
        get = {
            "responses": {"200": {**answers(_of(wrapped([]))), "headers": headers or {}}},
            "parameters": list(parameters),
            "summary": says,
        }
        document = described(
            {"/valves": {"get": get, "post": {"responses": {"201": {"description": "made"}}}}}, "3.1.0"
        )
        self.checkers = RestCheckers(contract_of(tmp_path, document), BASE)
        self.wrapped, self.now, self.cases = wrapped, 1000.0, []

    def read(self, items, headers=(), after=1.0, body=None, **query):
        """Judge one list."""
        octets = json.dumps(self.wrapped(items) if body is None else body).encode()
        target = f"/valves?{urlencode(query, safe=',')}" if query else "/valves"
        return self._judge("GET", target, 200, (("Content-Type", "application/json"), *headers), octets, after)

    def write(self):
        """Judge a POST."""
        return self._judge("POST", "/valves", 201, (), b"", 0.1)

    def _judge(self, method, target, status, headers, octets, after):
        self.now += after
        request = Request(method, BASE + target, (("Host", "device:8000"),))
        exchange = Exchange(request, Response(status, headers, octets, 1.0, received_s=self.now))
        self.cases += [one for one in self.checkers(exchange) if one.requirement.startswith(_JUDGED)]
        return self

    @property
    def broken(self):
        return {one.requirement for one in self.cases if not one.holds}

    @property
    def judged(self):
        return {one.requirement for one in self.cases}
