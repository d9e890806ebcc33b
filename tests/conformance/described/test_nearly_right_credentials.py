"""Each way to look at credentials too lightly is found, on a device with few operations; the right device passes."""

import hashlib
import itertools
import json

import pytest
from aiohttp import web
from small_device import REFUSED, answers, body_of, certified, described, error, object_of, small_device

TOKEN = "Sesame-4711-Abc"  # noqa: S105 - of this device alone
_SETTINGS = object_of(
    "rate", "unit", rate={"type": "integer", "minimum": 1, "maximum": 3600}, unit={"enum": ["C", "F"]}
)
_ZONE = object_of("name", name={"type": "string", "minLength": 1})
_MADE = object_of("id", "name", id={"type": "integer"}, name={"type": "string"})
_ID = {"name": "zone", "in": "path", "required": True, "schema": {"type": "integer"}}
_CLOSED = [{"token": []}]
_MATCH = {"name": "If-Match", "in": "header", "schema": {"type": "string"}}
_LOOKS = {
    "the token may be empty": lambda scheme, token: (scheme, token or TOKEN),
    "a shorter token is taken": lambda scheme, token: (scheme, TOKEN if token and TOKEN.startswith(token) else token),
    "a longer token is taken": lambda scheme, token: (scheme, TOKEN if token.startswith(TOKEN) else token),
    "the token's case is ignored": lambda scheme, token: (scheme, TOKEN if token.lower() == TOKEN.lower() else token),
    "each scheme is taken": lambda _, token: ("bearer", token),
}


class Locker:
    """A device whose writes need a token, and whose settings need If-Match as well.

    Args:
        fault: how it looks at credentials; empty: as it should.
    """

    def __init__(self, fault=""):
        self.fault, self.ids = fault, itertools.count(3)
        self.settings, self.zones = {"rate": 60, "unit": "C"}, {1: "north", 2: "south"}

    def description(self):
        """Return its description."""
        zone = {"200": answers(_MADE), "4XX": REFUSED}
        done = {"200": answers(_SETTINGS), "4XX": REFUSED}
        put = {"requestBody": body_of(_SETTINGS), "parameters": [_MATCH], "responses": done, "security": _CLOSED}
        post = {
            "requestBody": body_of(_ZONE),
            "responses": {"201": answers(_MADE), "4XX": REFUSED},
            "security": _CLOSED,
        }
        paths = {
            "/settings": {"get": {"responses": done}, "put": put},
            "/zones": {"get": {"responses": {"200": answers({"type": "array", "items": _MADE})}}, "post": post},
            "/zones/{zone}": {
                "parameters": [_ID],
                "get": {"responses": zone},
                "delete": {"responses": {"204": {"description": "gone"}, "4XX": REFUSED}, "security": _CLOSED},
            },
        }
        schemes = {"securitySchemes": {"token": {"type": "http", "scheme": "bearer"}}}
        return described(paths, components=schemes)

    def routes(self):
        """Return the handlers of its paths."""
        return {
            "/settings": {"GET": self.read, "PUT": self.replace},
            "/zones": {"GET": self.list_zones, "POST": self.create},
            "/zones/{zone}": {"GET": self.read_zone, "DELETE": self.delete},
        }

    def refusal(self, request):
        scheme, _, token = request.headers.get("Authorization", "").partition(" ")
        scheme, token = _LOOKS.get(self.fault, lambda *both: both)(scheme.lower(), token)
        if scheme == "bearer" and token == TOKEN:
            return None
        return error(401, "a token is needed", **{"WWW-Authenticate": "Bearer"})

    @property
    def tag(self):
        return f'"{hashlib.sha256(json.dumps(self.settings).encode()).hexdigest()[:9]}"'

    async def read(self, _):
        return web.json_response(self.settings, headers={"ETag": self.tag})

    async def replace(self, request):
        refusal = None if self.fault == "a replacement needs no token" else self.refusal(request)
        if refusal is not None:
            if self.fault == "what is refused counts":
                self.settings["rate"] = self.settings["rate"] % 3600 + 1
            return refusal
        given = request.headers.get("If-Match")
        if given != "*" and self.tag not in (given or "").split(", "):
            return error(412 if given else 428, "If-Match")
        try:
            sent = await request.json()
            rate, unit = sent["rate"], sent["unit"]
        except (ValueError, TypeError, KeyError):
            return error(422, "rate and unit")
        if type(rate) is not int or not 1 <= rate <= 3600 or unit not in ("C", "F"):
            return error(422, "rate and unit")
        self.settings = {"rate": rate, "unit": unit}
        return await self.read(request)

    async def list_zones(self, _):
        return web.json_response([{"id": id_, "name": name} for id_, name in self.zones.items()])

    async def create(self, request):
        if (refusal := self.refusal(request)) is not None:
            return refusal
        try:
            name = (await request.json())["name"]
        except (ValueError, TypeError, KeyError):
            return error(422, "a name")
        if not isinstance(name, str) or not name:
            return error(422, "a name")
        number = next(self.ids)
        self.zones[number] = name
        return web.json_response({"id": number, "name": name}, status=201, headers={"Location": f"/zones/{number}"})

    async def read_zone(self, request):
        number = int(request.match_info["zone"]) if request.match_info["zone"].isdigit() else 0
        if number not in self.zones:
            return error(404, "no such zone")
        return web.json_response({"id": number, "name": self.zones[number]})

    async def delete(self, request):
        found = await self.read_zone(request)
        refusal = self.refusal(request)
        if found.status == 200 and (refusal is None or self.fault == "what is refused is deleted"):
            del self.zones[int(request.match_info["zone"])]
        return refusal or (found if found.status != 200 else web.Response(status=204))


def _certified(fault, tmp_path, *more):
    (secret := tmp_path / "token").write_text(TOKEN, encoding="utf-8")
    secret.chmod(0o600)
    device = Locker(fault)
    with small_device(device.description(), device.routes()) as url:
        return certified(f"{url}/openapi.json", tmp_path / "out", "--call=*", "--token-file", secret, *more)


def test_a_device_that_looks_closely_is_right(tmp_path):
    done = _certified("", tmp_path)
    assert "fail" not in done.blamed.values(), done.text
    assert not done.blamed.keys() & {"description/security", "description/refused-keeps"}, done.text


@pytest.mark.side_by_side
@pytest.mark.parametrize(
    ("fault", "broken"),
    [
        *((fault, "security") for fault in [*_LOOKS, "a replacement needs no token"]),
        ("what is refused counts", "refused-keeps"),
        ("what is refused is deleted", "refused-keeps"),
    ],
)
def test_a_device_that_does_not_look_closely_is_found(fault, broken, tmp_path):
    done = _certified(fault, tmp_path, "--class=description")
    assert done.blamed.get(f"description/{broken}") == "fail", done.text
