"""What the description marks as writeOnly is shown by no response."""

import json

import pytest
from small_device import answers, contract_of, described

from conformance.checkers.rest import RestCheckers
from conformance.transport.exchange import Exchange, Request, Response

_BASE = "http://device"
_KEY = {"type": ["string", "null"], "writeOnly": True}
_USER = {"type": "object", "properties": {"name": {"type": "string"}, "key": _KEY}}
_SCHEMAS = {
    "plain": _USER,
    "list": {"type": "array", "items": _USER},
    "page": {"type": "object", "properties": {"items": {"type": "array", "items": _USER}}},
    "composed": {"allOf": [{"type": "object", "properties": {"id": {"type": "integer"}}}, _USER]},
    "inner": {"type": "object", "properties": {"owner": _USER}},
}


def _wrapped(kind, user):
    return {"list": [{}, user], "page": {"items": [user]}, "inner": {"owner": user}}.get(kind, user)


def _blamed(kind, user, folder):
    document = described({"/it": {"get": {"responses": {"200": answers(_SCHEMAS[kind])}}}}, "3.1.0")
    contract = contract_of(folder, document)
    response = Response(200, (("Content-Type", "application/json"),), json.dumps(_wrapped(kind, user)).encode(), 1.0)
    cases = RestCheckers(contract, _BASE)(Exchange(Request("GET", f"{_BASE}/it", (), b""), response))
    return [one.observed for one in cases if one.requirement == "description/read-only" and not one.holds]


@pytest.mark.parametrize("kind", _SCHEMAS)
def test_a_value_that_is_shown_is_blamed(kind, tmp_path):
    assert _blamed(kind, {"name": "a", "key": "s3cret"}, tmp_path) == ["key in the response"]


@pytest.mark.parametrize("kind", _SCHEMAS)
@pytest.mark.parametrize("user", [{"name": "a"}, {"key": None}, {"key": "********"}, {"key": ""}])
def test_what_is_left_out_or_masked_is_not(kind, user, tmp_path):
    assert _blamed(kind, user, tmp_path) == []
