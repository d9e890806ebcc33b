"""Mutants of what one exchange promises for the next: each alters the exchange that breaks it, and no other one."""

import http.client
import json
import re

import pytest
from small_device import contract_of, small_device
from sprinklers import sprinklers

from proof.mutation.messages import Request, Response
from proof.selftest.generated.described import described_mutants
from proof.selftest.generated.mutant import Tally

_JSON, _TAG = {"Content-Type": "application/json"}, {"If-Match": "{tag}"}
_FILE = {"Content-Type": "application/octet-stream"}
_OTHER = {"name": "x", "minutes": 1.23456, "starts": "2026-02-01T12:00:00+02:00"}
_READ = ("GET", "/zones/z1", {}, None)
_PUT = ("PUT", "/zones/z1", {**_JSON, **_TAG}, {"name": "a"})
_PUT_NEXT = ("PUT", "/zones/z1", {**_JSON, **_TAG}, _OTHER)
_MAP = ("PUT", "/zones/z1/map", _FILE, b"0123456789")
_PART = ("GET", "/zones/z1/map", {"Range": "bytes=2-5"}, None)


def _keyed(key, body):
    return ("POST", "/zones", {**_JSON, "Idempotency-Key": key}, body)


#: Name of a mutant; exchanges that it leaves alone, and the one after them that it alters, and its status.
_ROWS = {
    "read-acts:GET /weather": ([_READ, _PUT, _READ, _PUT_NEXT], ("GET", "/weather", {}, None), 200),
    "head-acts:GET /weather": ([_READ, _PUT, _READ, _PUT_NEXT], ("HEAD", "/weather", {}, None), 200),
    "stale-304:GET /zones/{id}": ([_READ, _PUT, _READ], ("GET", "/zones/z1", {"If-None-Match": "{first}"}, None), 304),
    "part-shifted:GET /zones/{id}/map": ([_MAP], _PART, 206),
    "part-total:GET /zones/{id}/map": ([_MAP], _PART, 206),
    "range-stale:GET /zones/{id}/map": ([_MAP, _PART], (*_PART[:2], {**_PART[2], "If-Range": '"x"'}, None), 206),
    "digest:GET /log": ([_READ], ("GET", "/log", {}, None), 200),
    "row-lost:GET /zones": ([_READ], ("GET", "/zones", {"Accept": "text/csv"}, None), 200),
    "row-quotes:GET /zones": (
        [_READ, (*_PUT[:3], {"name": 'a"b'})],
        ("GET", "/zones", {"Accept": "text/csv"}, None),
        200,
    ),
    "list-other:GET /zones": ([_READ], ("GET", "/zones", {}, None), 200),
    "key-again:POST /zones": ([_keyed("a", _OTHER), _keyed("b", _OTHER)], _keyed("a", _OTHER), 201),
    "key-any-body:POST /zones": ([_keyed("a", _OTHER), _keyed("a", _OTHER)], _keyed("a", {"name": "n"}), 201),
    "key-old:POST /zones": ([_keyed("a", _OTHER), _keyed("a", _OTHER)], _keyed("b", {"name": "n"}), 201),
    "key-spent:POST /zones": ([_keyed("a", {})], _keyed("a", {"name": "n"}), 422),
    "type-any:PUT /zones/{id}": ([_READ], (*_PUT[:2], {**_TAG, "Content-Type": "text/plain"}, _OTHER), 200),
    "match-first:PUT /zones/{id}": ([_READ], (*_PUT[:2], {**_JSON, "If-Match": '"x", {tag}'}, _OTHER), 412),
    "file-tail:PUT /zones/{id}/map": ([_MAP], (*_MAP[:3], b"01"), 200),
    "match-missing:PUT /zones/{id}": ([_READ, _PUT, _READ], (*_PUT[:2], _JSON, _OTHER), 200),
    "match-stale:PUT /zones/{id}": ([_READ, _PUT, _READ], (*_PUT[:2], {**_JSON, "If-Match": "{first}"}, _OTHER), 200),
    "applies-412:DELETE /zones/{id}": ([_READ], ("DELETE", "/zones/z1", {"If-Match": '"x"'}, None), 412),
    "applies-428:PATCH /zones/{id}": ([_READ], ("PATCH", "/zones/z1", _JSON, {"name": "y"}), 428),
    "applies-406:POST /zones": ([_READ], ("POST", "/zones", {**_JSON, "Accept": "text/x"}, {"name": "y"}), 406),
    "none-ignored:PUT /zones/{id}": ([_READ, _PUT], (*_PUT[:2], {**_PUT[2], "If-None-Match": "*"}, _OTHER), 200),
    "file-cut:PUT /zones/{id}/map": ([_READ], _MAP, 200),
    "digits:PUT /zones/{id}": ([_READ, _PUT, _READ], _PUT_NEXT, 200),
    "offset:PUT /zones/{id}": ([_READ, _PUT, _READ], _PUT_NEXT, 200),
}


@pytest.mark.parametrize("name", _ROWS)
def test_a_mutant_breaks_a_promise(name, tmp_path):
    document, routes = sprinklers({})
    mutants = described_mutants(contract_of(tmp_path, document))
    mutant, tally, tags = {one.name: one for one in mutants}[f"{name}:promise"], Tally(), [""]
    change = mutant.make(tally)
    before, (method, path, fields, body), status = _ROWS[name]
    with small_device(document, routes) as url:

        def forward(request):
            connection = http.client.HTTPConnection(url.removeprefix("http://"))
            connection.request(request.method, request.target, request.body, dict(request.fields))
            answer = connection.getresponse()
            response = Response(answer.status, answer.getheaders(), answer.read(), method=request.method)
            connection.close()
            return response

        def send(method, path, fields, body):
            texts = {"tag": tags[-1], "first": tags[1] if len(tags) > 1 else ""}
            sent = [(key, re.sub(r"\{(\w+)\}", lambda one: texts[one[1]], value)) for key, value in fields.items()]
            octets = body if isinstance(body, bytes) else b"" if body is None else json.dumps(body).encode()
            response = change(Request("rest", method, path, fields=sent, body=octets), forward)
            if (tag := response.field("ETag")) is not None and path.endswith("z1"):
                tags.append(tag)
            return response

        for one in before:
            assert send(*one).status < 300 or name.startswith("key-spent")
        assert tally.altered == 0
        assert send(method, path, fields, body).status == status
    assert tally.altered == 1


#: Mutants of items reach another item, or carry out what they refuse; a device without two items is left as it is.
_BODY = {"content": {"application/json": {"schema": {"type": "object"}}}}
_ANSWER = {"responses": {"200": {"description": "", **_BODY}}}
_LAMPS = {
    "openapi": "3.1.0",
    "info": {"title": "Lamps", "version": "1"},
    "paths": {
        "/lamps/{id}": {
            "parameters": [{"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}],
            **dict.fromkeys(("get", "delete"), _ANSWER),
            "put": {"requestBody": _BODY, **_ANSWER},
        }
    },
}
_ITEM_READS = [("GET", "1", ""), ("GET", "2", "")]
_STEPS = [
    ("reaches-another:DELETE /lamps/{id}:item", [*_ITEM_READS, ("DELETE", "1", "")], {}, 1),
    ("reaches-another:PUT /lamps/{id}:item", [*_ITEM_READS, ("PUT", "1", "x")], {"1": "x", "2": "x"}, 1),
    ("applies-refused:PUT /lamps/{id}:item", [*_ITEM_READS, ("PUT", "1", "x", "text/plain")], {"1": "x", "2": "b"}, 1),
    ("another-item:GET /lamps/{id}:item", [*_ITEM_READS, ("PUT", "1", "x", "text/plain"), ("GET", "1", "")], None, 1),
    ("reaches-another:DELETE /lamps/{id}:item", [("GET", "1", ""), ("DELETE", "1", "")], {"2": "b"}, 0),
    ("another-item:GET /lamps/{id}:item", [*_ITEM_READS, ("GET", "1", "")], {"1": "a", "2": "b"}, 0),
]


@pytest.mark.parametrize(("name", "requests", "left", "altered"), _STEPS)
def test_a_request_reaches_another_item(name, requests, left, altered, tmp_path):
    contract = contract_of(tmp_path, _LAMPS)
    mutant = {one.name: one for one in described_mutants(contract, "/v1")}[name]
    there, tally = {"1": "a", "2": "b"}, Tally()

    def lamps(request):
        last = request.path.rpartition("/")[2]
        if last not in there or (request.method == "PUT" and request.media_type != "application/json"):
            return Response(404 if last not in there else 415)
        if request.method == "PUT":
            there[last] = json.loads(request.body)
        value = there.pop(last) if request.method == "DELETE" else there[last]
        return Response(200, [("Content-Type", "application/json")], json.dumps(value).encode())

    change, response = mutant.make(tally), None
    for method, last, value, *media_type in requests:
        fields = [("Content-Type", *media_type)] if media_type else [("Content-Type", "application/json")]
        request = Request("rest", method, f"/v1/lamps/{last}", fields=fields, body=json.dumps(value).encode())
        response = change(request, lamps)
    assert tally.altered == altered
    assert json.loads(response.body) == "b" if left is None else there == left
