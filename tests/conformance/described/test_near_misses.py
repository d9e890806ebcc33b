"""Values next to allowed ones, and lists in each other, are sent at quick to any described device."""

import json
import re

import pytest
from aiohttp import web
from small_device import REFUSED, answers, body_of, certified, described, error, small_device

_TIME = "^([01][0-9]|2[0-3]):[0-5][0-9]$"
_SCHEMA = {
    "type": "object",
    "required": ["closes", "locked"],
    "properties": {"closes": {"type": "string", "pattern": _TIME}, "locked": {"type": "boolean"}},
}
_PATHS = {
    "/shutter": {
        "get": {"responses": {"200": answers(_SCHEMA)}},
        "put": {"requestBody": body_of(_SCHEMA), "responses": {"200": answers(_SCHEMA), "4XX": REFUSED}},
    }
}


class _Shutter:
    """A shutter that closes at a time of the day; `fault` is what it does wrong, if anything."""

    def __init__(self, fault):
        self.fault = fault
        self.now = {"closes": "21:30", "locked": False}
        self.pattern = re.compile("[0-2][0-9]:[0-5][0-9]" if fault == "hours to 29" else _TIME.strip("^$"))
        self.words = {"true": True, "false": False} if fault == "words for truth values" else {}

    async def get(self, _):
        return web.json_response(self.now)

    async def put(self, request):
        try:
            sent = json.loads(await request.read())
        except ValueError:
            return error(400, "no JSON")
        except RecursionError:
            return error(500 if self.fault == "deep lists" else 400, "too deep")
        if not isinstance(sent, dict) or not isinstance(sent.get("closes"), str):
            return error(422, "no time")
        locked = sent.get("locked")
        locked = self.words.get(locked, locked) if isinstance(locked, str) else locked
        if not self.pattern.fullmatch(sent["closes"]) or not isinstance(locked, bool):
            return error(422, "no shutter closes then")
        self.now = {"closes": sent["closes"], "locked": locked}
        return web.json_response(self.now)


@pytest.mark.parametrize(
    ("fault", "requirement"),
    [
        ("", ""),
        ("hours to 29", "description/invalid-refused"),
        ("words for truth values", "description/types"),
        ("deep lists", "robustness/no-server-error"),
    ],
)
def test_each_is_found_and_the_right_device_not_blamed(fault, requirement, tmp_path):
    shutter = _Shutter(fault)
    routes = {"/shutter": {"GET": shutter.get, "PUT": shutter.put}}
    with small_device(described(_PATHS), routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--call=*")
    assert requirement in done.blamed if fault else not done.blamed, done.text
    # Frameworks do so, and a right device on one of them does not fail.
    assert fault != "deep lists" or done.blamed == {requirement: "warn"}, done.text
