"""Reads of items, one after another: the item of the path, under whatever other names, and other items in its place."""

import json

import pytest

from conformance.checkers.rest import RestCheckers
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.transport.exchange import Exchange, Request, Response

_BASE = "http://device:80"


def _paths(name, schema):
    item = {"parameters": [{"in": "path", "name": name, "required": True, "schema": schema}]}
    answered = {"200": {"description": "", "content": {"application/json": {"schema": {}}}}}
    each = {method: {"responses": answered} for method in ("get", "put", "patch", "delete")}
    return {"/things": {"get": {"responses": answered}}, f"/things/{{{name}}}": {**item, **each}}


@pytest.fixture(scope="module", params=[("id", {"type": "integer"}), ("thing_id", {}), ("name", {"type": "string"})])
def contract(request, tmp_path_factory):
    document = {"openapi": "3.1.0", "info": {"title": "t", "version": "1"}, "paths": _paths(*request.param)}
    return Contract.load(write_described_pack(tmp_path_factory.mktemp("pack"), document, document)), request.param[0]


def _wrong(contract, reads):
    """Return which of some exchanges is blamed, each given by its method, the end of its path, and the identifiers."""
    pack, name = contract
    member = "id" if name == "thing_id" else name
    numbers = {} if name == "name" else {letter: index for index, letter in enumerate("abcde")}

    def id_of(one):
        return numbers.get(one, one)

    checkers, found = RestCheckers(pack, _BASE), []
    for turn, (method, last, answered) in enumerate(reads):
        body = [{member: id_of(one)} for one in answered] if not last else {member: id_of(answered[0]), "more": 1}
        path = f"/things/{id_of(last)}" if last else "/things"
        request = Request(method, _BASE + path, (("Host", "device"), ("Accept", "*/*")))
        answer = Response(200, (("Content-Type", "application/json"),), json.dumps(body).encode(), 1.0)
        cases = [one for one in checkers(Exchange(request, answer)) if one.requirement == "description/own-identifier"]
        found += [turn for one in cases if not one.holds]
    return found


_LIST = ("GET", "", ["a", "b", "c"])
_RIGHT = {
    "each its own": [_LIST, ("GET", "a", ["a"]), ("GET", "b", ["b"]), ("GET", "a", ["a"])],
    "another name": [_LIST, ("GET", "a", ["a"]), ("GET", "x-current", ["a"]), ("GET", "x-current", ["b"])],
    "never its own": [_LIST, ("GET", "a", ["c"]), ("GET", "b", ["c"])],
    "renamed": [_LIST, ("GET", "a", ["a"]), ("PATCH", "a", ["e"]), ("GET", "a", ["e"])],
    "HEAD and no identifier": [_LIST, ("GET", "a", ["a"]), ("HEAD", "a", ["b"]), ("GET", "a", [None])],
    "an identifier of another kind": [_LIST, ("GET", "a", ["a"]), ("GET", "b", ["x-17"])],
}
_WRONG = {
    "the first one later": ([("GET", "b", ["b"]), ("GET", "b", ["a"])], [1]),
    "always the first one": ([_LIST, ("GET", "a", ["a"]), ("GET", "b", ["a"]), ("GET", "c", ["a"])], [2, 3]),
    "one of those created later": ([("GET", "a", ["a"]), ("GET", "b", ["b"]), _LIST, ("GET", "c", ["b"])], [3]),
    "after a change of another": ([("GET", "a", ["a"]), ("PUT", "b", ["b"]), ("GET", "a", ["b"])], [2]),
    "after a deletion": ([_LIST, ("GET", "b", ["b"]), ("DELETE", "a", ["a"]), ("GET", "b", ["c"])], [3]),
}


@pytest.mark.parametrize("style", _RIGHT)
def test_a_right_device_is_not_blamed(style, contract):
    assert _wrong(contract, _RIGHT[style]) == []


@pytest.mark.parametrize("fault", _WRONG)
def test_another_item_is_found(fault, contract):
    reads, expected = _WRONG[fault]
    assert _wrong(contract, reads) == expected
