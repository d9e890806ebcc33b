"""Content codings of a device: right in several ways, and wrong in one."""

import gzip
import json
import zlib

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, described, small_device

_ITEM = {"type": "object", "required": ["id"], "properties": {"id": {"type": "integer"}, "name": {"type": "string"}}}
_LISTS = {"/valves": 90, "/pumps": 60, "/tanks": 3}


def _quality(request, coding):
    """Return the weight of a coding in Accept-Encoding; 0: it is not wanted."""
    parts = [one.strip().partition(";q=") for one in request.headers.get("Accept-Encoding", "").lower().split(",")]
    weights = {name: float(weight or 1) for name, _, weight in parts}
    return weights.get(coding, weights.get("*", 0))


def _device(kind, reads):
    def listed(path):
        items = [{"id": number, "name": f"{path} {number}"} for number in range(_LISTS[path])]

        async def handle(request):
            reads.append(path)
            plain = json.dumps(items).encode()
            takes = _quality(request, "gzip") > 0
            back = {"ETag": '"plain"', "Vary": "Accept-Encoding"}
            if kind == "counts":
                plain = json.dumps([{"id": len(reads)}, *items]).encode()
                del back["ETag"]
            if (
                kind == "none"
                or not (takes or (kind == "never refused" and "Accept-Encoding" in request.headers))
                or len(plain) < 200
            ):
                return web.Response(body=plain, content_type="application/json", headers=back)
            packed = gzip.compress(json.dumps(items[1:]).encode() if kind == "another content" else plain)
            if kind == "members":
                packed = gzip.compress(plain[:50]) + gzip.compress(plain[50:])
            packed = {
                "cut": packed[:-12],
                "no checksum": packed[:-8] + b"\0" * 8,
                "more after it": packed + b"0\r\n\r\n",
                "zlib's form": zlib.compress(plain),
                "plain": plain,
            }.get(kind, packed)
            back |= {"ETag": '"packed"', "Content-Encoding": "gzip"}
            if kind == "one tag":
                back["ETag"] = '"plain"'
            if kind == "no Vary":
                del back["Vary"]
            if kind == "private":
                back |= {"Vary": "Accept", "Cache-Control": "private, no-cache"}
            if kind == "brotli":
                back["Content-Encoding"] = "br"
            return web.Response(body=packed, content_type="application/json", headers=back)

        return {"GET": handle}

    shape = answers({"type": "array", "items": _ITEM})
    description = described({path: {"get": {"responses": {"200": shape}}} for path in _LISTS})
    return small_device(description, {path: listed(path) for path in _LISTS})


@pytest.mark.parametrize("kind", ["right", "none", "members", "private", "counts"])
def test_right_codings(kind, tmp_path):
    with _device(kind, []) as url:
        done = certified(f"{url}/openapi.json", tmp_path)
    assert not done.blamed, done.text


@pytest.mark.side_by_side
@pytest.mark.parametrize(
    ("kind", "blamed"),
    [
        *((kind, "content-coding") for kind in ("cut", "no checksum", "more after it", "zlib's form", "plain")),
        ("another content", "content-coding"),
        *((kind, "accept-encoding") for kind in ("never refused", "one tag", "no Vary", "brotli")),
    ],
)
def test_wrong_codings(kind, blamed, tmp_path):
    with _device(kind, []) as url:
        done = certified(
            f"{url}/openapi.json",
            tmp_path,
            *(f"--select=http/{name}" for name in ("content-coding", "accept-encoding")),
        )
    assert list(done.blamed) == [f"http/{blamed}"], done.text


_LEVELS = {"type": "array", "items": {"type": "integer"}}


def _levels(*, declares, refuses):
    """Return the description and the routes of a list that is there as JSON alone."""
    responses = {"200": answers(_LEVELS), **({"406": REFUSED} if declares else {})}

    async def read(request):
        accept = request.headers.get("Accept", "*/*").replace(" ", "")
        is_right = "*/*" in accept or ("application/json" in accept and "application/json;q=0" not in accept)
        if refuses(accept) and not is_right:
            return web.json_response({"title": "JSON is all there is"}, status=406)
        return web.json_response([1, 2])

    return described({"/levels": {"get": {"responses": responses}}}, "3.1.0"), {"/levels": {"GET": read}}


@pytest.mark.parametrize(
    ("declares", "refuses", "is_found"),
    [
        (True, lambda _: True, False),
        (False, lambda _: False, False),
        (True, lambda _: False, True),
        (True, lambda accept: "q=0" not in accept, True),
    ],
    ids=["refused", "not declared", "ignored", "q=0 ignored"],
)
def test_a_declared_406(tmp_path, declares, refuses, is_found):
    with small_device(*_levels(declares=declares, refuses=refuses)) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--class", "description")
    assert ("description/required" in done.blamed) is is_found, done.text
