"""Lists that no client expects: whatever a device answers, the run ends with verdicts, and without a suite error."""

import json

import pytest
from aiohttp import web
from small_device import answers, certified, described, small_device

from conformance.api.rest.listing import identity_of, items_of, members_of, page_of
from conformance.transport.exchange import Response

_DEEP: dict[str, object] = {"items": []}
for _ in range(200):
    _DEEP = {"data": _DEEP}
# What a list answers, whatever its parameters.
LISTS: dict[str, object] = {
    "mixed": [1, "a", None, [], {}, {"id": {}}, {"id": [1]}, {"state": {"a": 1}}, {"id": 10**400, "size": True}],
    "lists": [[1, 2], [1, 2], [[]]],
    "totals": {"items": [{"id": 1}], "total": -1, "count": "many", "totalCount": 1e308, "meta": {"total": [7]}},
    "true": {"items": [{"id": 1}, {"id": 1}], "total": True, "next": {"next": {"next": [None]}}},
    "deep": _DEEP,
    "empty": {"items": None, "data": {}, "results": []},
    "surrogates": [{"id": "\ud800", "state": "\x00", "size": "NaN"}, {"id": "\udfff", "state": "on", "size": "1e999"}],
    "loops": {"items": [{"id": one} for one in range(3)], "nextCursor": "x", "has_more": True, "total": 10**30},
    "many": [{"id": one % 7, "state": "on", "size": -one} for one in range(3000)],
}
_QUERY = {
    "limit": {"type": "integer"},
    "offset": {"type": "integer"},
    "cursor": {"type": "string"},
    "state": {"enum": ["on", "off", None, 1, True]},
    "size": {"type": ["number", "null"]},
    "sort": {"type": "array", "items": {"enum": ["-size", "size", "state", 7]}},
}
_ITEM = {"properties": {"id": {}, "state": {"enum": ["on", "off", 1]}, "size": {"type": "number"}}}


@pytest.mark.parametrize("name", LISTS)
def test_any_json_is_read_as_a_list_or_as_none(name):
    body = json.dumps(LISTS[name]).encode()
    page = page_of(Response(200, (("Content-Type", "application/json"), ("X-Total-Count", "²")), body, 1.0))
    assert (page is None) == (items_of(json.loads(body)) is None)
    assert page is None or (len(page.identities) == len(page.items) and all(map(identity_of, page.items)))
    assert page is None or all(isinstance(members_of(one), dict) for one in page.items)


def test_a_run_ends_with_verdicts_whatever_lists_hold(tmp_path):
    parameters = [{"in": "query", "name": name, "schema": schema} for name, schema in _QUERY.items()]
    shapes = {name: {"type": "array", "items": _ITEM} if isinstance(one, list) else {} for name, one in LISTS.items()}
    shown = {"type": "object", "properties": {"items": {"type": "array", "items": _ITEM}}}
    paths = {
        f"/{name}": {"get": {"parameters": parameters, "responses": {"200": answers(shapes[name] or shown)}}}
        for name in LISTS
    }

    def answering(value):
        async def answer(_):
            return web.Response(text=json.dumps(value), content_type="application/json")

        return {"GET": answer}

    routes = {f"/{name}": answering(value) for name, value in LISTS.items()}
    with small_device(described(paths, "3.1.0"), routes) as url:
        done = certified(url, tmp_path / "out", "--class", "description")
    verdicts = {one["id"]: one["verdict"] for one in done.result["requirements"]}
    assert "error" not in verdicts.values(), done.text
    assert "not judged: " not in done.text, done.text
    assert verdicts["description/list-limit"] == "fail"
