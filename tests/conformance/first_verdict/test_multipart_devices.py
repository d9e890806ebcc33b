"""Parts of multipart bodies are written by RFC 7578, and each text in one is a valid string."""

from aiohttp import BodyPartReader, web
from small_device import REFUSED, body_of, certified, constant, described, error, object_of, reading, small_device

_BINARY = {"type": "string", "format": "binary"}
_SCHEMA = object_of(
    "map",
    map=_BINARY,
    name={"type": "string"},
    level={"type": "integer", "minimum": 0, "maximum": 9},
    layers={"type": "array", "items": _BINARY, "maxItems": 3},
)
_BODY = body_of(_SCHEMA, "multipart/form-data")
_PATHS = {
    "/maps": {"post": {"requestBody": _BODY, "responses": {"204": {"description": "stored"}, "4XX": REFUSED}}},
    "/state": reading({"type": "object"}),
}


async def _fields(request):
    """Return the content of each part by its name.

    Raises:
        ValueError and others, by aiohttp: the body is no multipart body.
    """
    found = {}
    async for part in await request.multipart():
        if not isinstance(part, BodyPartReader) or part.name is None:
            raise ValueError("no field")
        found.setdefault(part.name, []).append(bytes(await part.read()))
    return found


def _storing(is_right):
    async def handle(request):
        if request.content_type != "multipart/form-data":
            return error(415, "another media type")
        try:
            right = is_right(await _fields(request))
        except Exception:  # noqa: BLE001 - aiohttp raises several for malformed parts
            right = False
        return web.Response(status=204) if right else error(400, "not a map")

    return handle


def _strict(fields):
    level, names = fields.get("level", [b"0"]), fields.get("name", [])
    once = len(fields.get("map", [])) == len(level) == 1 and len(names) <= 1
    texts = [content.decode() for content in names]
    return once and len(texts) == len(names) and level[0] in b"0 1 2 3 4 5 6 7 8 9".split() and _few(fields)


def _few(fields):
    return len(fields.get("layers", [])) <= _SCHEMA["properties"]["layers"]["maxItems"]


_LAX = {"/maps": {"POST": _storing(lambda fields: "map" in fields)}, "/state": constant({})}


def test_a_device_that_takes_every_text_passes(tmp_path):
    with small_device(described(_PATHS), {"/maps": {"POST": _storing(_strict)}, "/state": constant({})}) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*")
    assert seen.blamed == {}
    assert seen.result["api"]["operations"][0]["statuses"].get("204")


def test_a_device_that_takes_every_level_is_caught(tmp_path):
    with small_device(described(_PATHS), _LAX) as url:
        more = ("--call", "*", "--select", "description/invalid-refused")
        seen = certified(f"{url}/openapi.json", tmp_path / "out", *more)
    assert seen.blamed.get("description/invalid-refused") == "fail"
