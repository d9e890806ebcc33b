"""Mutants of items reach another item, or carry out what they refuse; a device without two items is left as it is."""

import json

import pytest
from small_device import contract_of

from proof.mutation.messages import Request, Response
from proof.selftest.generated.described import described_mutants
from proof.selftest.generated.mutant import Tally

_BODY = {"content": {"application/json": {"schema": {"type": "object"}}}}
_ANSWER = {"responses": {"200": {"description": "", **_BODY}}}
_DESCRIPTION = {
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
_READS = [("GET", "1", ""), ("GET", "2", "")]
_ROWS = [
    ("reaches-another:DELETE /lamps/{id}:item", [*_READS, ("DELETE", "1", "")], {}, 1),
    ("reaches-another:PUT /lamps/{id}:item", [*_READS, ("PUT", "1", "x")], {"1": "x", "2": "x"}, 1),
    ("applies-refused:PUT /lamps/{id}:item", [*_READS, ("PUT", "1", "x", "text/plain")], {"1": "x", "2": "b"}, 1),
    ("another-item:GET /lamps/{id}:item", [*_READS, ("PUT", "1", "x", "text/plain"), ("GET", "1", "")], None, 1),
    ("reaches-another:DELETE /lamps/{id}:item", [("GET", "1", ""), ("DELETE", "1", "")], {"2": "b"}, 0),
    ("another-item:GET /lamps/{id}:item", [*_READS, ("GET", "1", "")], {"1": "a", "2": "b"}, 0),
]


@pytest.mark.parametrize(("name", "requests", "left", "altered"), _ROWS)
def test_a_request_reaches_another_item(name, requests, left, altered, tmp_path):
    contract = contract_of(tmp_path, _DESCRIPTION)
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
