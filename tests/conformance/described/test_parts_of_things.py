"""Writes to a part of a thing that has no read of its own: each thing and the list show what the response showed."""

import json
import time

import pytest
from aiohttp import web
from small_device import REFUSED, answers, body_of, certified, described, error, object_of, small_device

_PERCENT = {"type": "integer", "minimum": 0, "maximum": 100}
_VENT = object_of("vent", "opening_percent", vent={"type": "integer"}, opening_percent=_PERCENT)
_ID = {"name": "vent", "in": "path", "required": True, "schema": {"type": "integer", "minimum": 1, "maximum": 4}}
_SET = {"requestBody": body_of(object_of("percent", percent=_PERCENT)), "responses": {"200": answers(_VENT)}}
_SET["responses"]["4XX"] = REFUSED
_PATHS = {
    "/vents": {"get": {"responses": {"200": answers({"type": "array", "items": _VENT})}}},
    "/vents/{vent}": {"get": {"parameters": [_ID], "responses": {"200": answers(_VENT), "4XX": REFUSED}}},
    "/vents/{vent}/opening": {"put": {"parameters": [_ID], **_SET}},
}


class _Vents:
    """Four vents; `style` is how the device may show a change later, or what it does wrong."""

    def __init__(self, style):
        self.style = style
        self.openings = dict.fromkeys(range(1, 5), 30)
        self.before = dict(self.openings)
        self.changed_s = 0.0
        self.routes = {
            "/vents": {"GET": self.all},
            "/vents/{vent}": {"GET": self.one},
            "/vents/{vent}/opening": {"PUT": self.open},
        }

    def _shown(self, number, *, is_listed):
        is_recent = time.monotonic() - self.changed_s < 1
        is_old = (self.style == "list a second late" and is_listed and is_recent) or (
            self.style == "all a second late" and is_recent
        )
        is_old |= self.style == "old list" and is_listed
        return {"vent": number, "opening_percent": (self.before if is_old else self.openings)[number]}

    def _number(self, request):
        text = request.match_info["vent"]
        return int(text) if text in {"1", "2", "3", "4"} else 0

    async def all(self, _):
        return web.json_response([self._shown(number, is_listed=True) for number in self.openings])

    async def one(self, request):
        number = self._number(request)
        return web.json_response(self._shown(number, is_listed=False)) if number else error(404, "no such vent")

    async def open(self, request):
        number = self._number(request)
        try:
            sent = json.loads(await request.read())
        except ValueError:
            return error(400, "no JSON")
        percent = sent.get("percent") if isinstance(sent, dict) else None
        if not number:
            return error(404, "no such vent")
        if not isinstance(percent, int | float) or isinstance(percent, bool) or percent % 1 or not 0 <= percent <= 100:
            return error(422, "no percentage")
        if self.style != "old list":
            self.before = dict(self.openings)
        self.changed_s = time.monotonic()
        if not (self.style == "third forgotten" and number == 3):
            self.openings[number] = min(percent, 95) if self.style == "at most 95" else percent
        return web.json_response({"vent": number, "opening_percent": percent})


def _blamed(style, tmp_path):
    with small_device(described(_PATHS), _Vents(style).routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--call=*", "--class=description")
    return done.blamed, done.text


@pytest.mark.parametrize("style", ["as told", "all a second late", "list a second late"])
def test_a_right_device_is_not_blamed(style, tmp_path):
    blamed, text = _blamed(style, tmp_path)
    assert not blamed, text


@pytest.mark.parametrize(
    ("fault", "requirement"),
    [
        ("third forgotten", "description/written-is-read"),
        ("at most 95", "description/written-is-read"),
        ("old list", "description/same-values"),
    ],
)
def test_a_fault_is_found(fault, requirement, tmp_path):
    blamed, text = _blamed(fault, tmp_path)
    assert blamed.keys() == {requirement}, text
