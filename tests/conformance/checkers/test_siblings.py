"""A write to one thing that changes others is blamed, by reads and by lists; what moves or is shared is not."""

import json

import pytest
from small_device import REFUSED, answers, body_of, contract_of, described, object_of

from conformance.api.rest.things import another
from conformance.checkers.rest import RestCheckers
from conformance.transport.exchange import Exchange, Request, Response

_BASE = "http://device:8000"
_LAMP = {
    "type": "object",
    "properties": {
        "id": {"type": "string", "readOnly": True},
        "level": {"type": "number"},
        "grams": {"type": "number"},
        "on": {"type": "boolean"},
        "order": {"type": "integer"},
    },
}
_ANY = {"type": "number"}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_OK = {"200": answers(_LAMP), "4XX": REFUSED}
_PUT = {"requestBody": {"content": {"application/json": {"schema": _LAMP}}}, "responses": _OK}
_PATHS = {
    "/lamps": {"get": {"responses": {"200": answers({"type": "array", "items": _LAMP})}}},
    "/lamps/{id}": {"parameters": [_ID], "get": {"responses": _OK}, "put": _PUT},
    "/lamps/{id}/dimming": {"parameters": [_ID], "put": {**_PUT, "requestBody": body_of(object_of(percent=_ANY))}},
    "/lamps/{id}/blink": {"parameters": [_ID], "post": {"responses": _OK}},
}


@pytest.fixture(name="contract", scope="module")
def _contract(tmp_path_factory):
    return contract_of(tmp_path_factory.mktemp("pack"), described(_PATHS, "3.1.0"))


def _put(id_, **members):
    return "PUT", f"/lamps/{id_}", members, {"id": id_, **members}


def _dim(id_, percent):
    return "PUT", f"/lamps/{id_}/dimming", {"percent": percent}, {"id": id_, "level": percent}


def _get(id_, **members):
    return "GET", f"/lamps/{id_}", None, {"id": id_, **members}


def _list(**levels):
    return "GET", "/lamps", None, [{"id": id_, "level": level} for id_, level in levels.items()]


_BLINK = "POST", "/lamps/a/blink", None, {"id": "a"}
_FALLS = [
    step
    for grams in (7, 8, 9)
    for step in (_put("b", grams=grams), _get("b", grams=grams), _put("a", grams=1), _get("b", grams=0))
]
_STILL = [_get("b", grams=7)] * 4
_BROKEN = {
    "the next one takes the level": [
        _get("b", level=1), _put("a", level=5), _get("b", level=5), _put("a", level=6), _get("b", level=6)
    ],
    "seen in the list": [
        _list(a=0, b=1), _put("a", level=5), _list(a=5, b=5), _put("a", level=6), _list(a=6, b=6)
    ],
    "others lose a member": [*_STILL, *_FALLS],
    "a part of another, by another name": [
        _list(a=2, b=3), _dim("a", 50), _list(a=50, b=50), _dim("a", 60), _list(a=60, b=60),
    ],
}  # fmt: skip
_RIGHT = {
    "each has its own": [_list(a=0, b=1), _put("a", level=5), _list(a=5, b=1), _put("b", level=6), _list(a=5, b=6)],
    "each has its own part": [_list(a=2, b=3), _dim("a", 50), _list(a=50, b=3), _dim("b", 60), _list(a=50, b=60)],
    "a part that has the same value once": [_list(a=2, b=3), _dim("a", 50), _list(a=50, b=50), _dim("a", 60)],
    "once, by chance": [_get("b", level=1), _put("a", level=5), _get("b", level=5), _put("a", level=6)],
    "a level that moves": [
        _get("b", level=1), _get("b", level=2), _put("a", level=5), _get("b", level=5), _put("a", level=6),
        _get("b", level=6),
    ],
    "one alone is on": [
        *[_get("b", on=False)] * 4,
        *[step for _ in range(3) for step in (_put("b", on=True), _get("b", on=True), _put("a", on=True),
                                              _get("b", on=False))],
    ],
    "an order that moves up": [
        _get("b", order=1), _put("a", order=1), _get("b", order=2), _put("a", order=2), _get("b", order=1),
        _put("a", order=1), _get("b", order=2),
    ],
    "an action between": [
        _get("b", level=1), _put("a", level=5), _BLINK, _get("b", level=5), _put("a", level=6), _BLINK,
        _get("b", level=6),
    ],
    "the current one": [
        ("GET", "/lamps/current", None, {"id": "a", "level": 0}), _put("a", level=5),
        ("GET", "/lamps/current", None, {"id": "a", "level": 5}), _put("a", level=6),
        ("GET", "/lamps/current", None, {"id": "a", "level": 6}),
    ],
}  # fmt: skip


def _blamed(contract, steps):
    checkers, found = RestCheckers(contract, _BASE), set()
    for number, (method, path, sent, shown) in enumerate(steps):
        kind = (("Content-Type", "application/json"),)
        fields = (("Host", "device:8000"), *(kind if sent else ()))
        request = Request(method, _BASE + path, fields, json.dumps(sent).encode() if sent else b"")
        exchange = Exchange(request, Response(200, kind, json.dumps(shown).encode(), 1.0, received_s=10.0 * number))
        found |= {case.doubt for case in checkers(exchange) if not case.holds and case.cause.endswith("of another")}
    return found


@pytest.mark.parametrize("name", _BROKEN)
def test_a_write_that_changes_another_thing_is_blamed(contract, name):
    assert _blamed(contract, _BROKEN[name]) == {""}


@pytest.mark.parametrize("name", _RIGHT)
def test_things_that_move_or_have_their_own_values_are_not(contract, name):
    assert _blamed(contract, _RIGHT[name]) == set()


def test_other_values_show_a_lost_offset_and_a_lost_case():
    parts = {"until": {"type": "string", "format": "date-time"}, "mail": {"type": "string", "format": "email"}}
    made = another({"properties": parts}, {"until": "2026-01-31T12:00:00Z", "mail": "a@example.com"}, 1, frozenset())
    # Minutes of the offset, and the part of an address whose case counts (RFC 5321 2.4).
    assert made == {"until": "2026-02-02T12:00:00-03:30", "mail": "One1@example.com"}
