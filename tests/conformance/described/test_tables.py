"""Lists as CSV obey the filters that they obey as JSON."""

import pytest
from aiohttp import web
from driven_device import driven
from small_device import REFUSED, answers, described

from conformance.api.rest.values import Values
from conformance.scenarios.tables import tables

_ITEM = {"type": "object", "properties": {"number": {"type": "integer"}, "level": {"enum": ["low", "high"]}}}
_LEVEL = {"in": "query", "name": "level", "schema": _ITEM["properties"]["level"]}
_ENTRIES = [{"number": number, "level": "high" if number % 3 else "low"} for number in range(6)]


def _device(ignoring):
    """Return the description and the routes of a log whose filter some media types ignore."""
    listed = answers({"type": "array", "items": _ITEM})
    listed["content"]["text/csv"] = {"schema": {"type": "string"}}

    async def entries(request):
        media_type = "text/csv" if "csv" in request.headers.get("Accept", "") else "application/json"
        level = "" if media_type in ignoring else request.query.get("level", "")
        found = [one for one in _ENTRIES if level in {"", one["level"]}]
        if media_type == "application/json":
            return web.json_response(found)
        text = "".join(f"{one['number']},{one['level']}\r\n" for one in found)
        return web.Response(text=f"number,level\r\n{text}", content_type="text/csv")

    paths = {"/log": {"get": {"parameters": [_LEVEL], "responses": {"200": listed, "4XX": REFUSED}}}}
    return described(paths, "3.1.0"), {"/log": {"GET": entries}}


@pytest.mark.parametrize(
    ("ignoring", "is_found"), [((), False), (("text/csv",), True), (("text/csv", "application/json"), False)]
)
def test_a_filter_holds_for_both_formats(tmp_path, ignoring, is_found):
    with driven(*_device(ignoring), tmp_path) as (api, _, _):
        found = tables.play(api, Values({}, frozenset()))
    assert [bool(one.fault) for one in found if one.fault] == [True] * is_found
