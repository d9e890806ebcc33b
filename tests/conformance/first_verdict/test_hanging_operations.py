"""A device of which some operations never answer ends soon, is judged by the others, and a slow one is not blamed."""

import asyncio
import time

import pytest
from aiohttp import web
from small_device import certified, described, reading, small_device

_SCHEMA = {"type": "object", "required": ["level"], "properties": {"level": {"type": "integer"}}}
_PATHS = [f"/tank{number}" for number in range(8)]


def _device(hanging, takes_s=0.0):
    async def handle(request: web.Request) -> web.Response:
        await asyncio.sleep(3600 if request.path in hanging else takes_s)
        return web.json_response({"level": "full" if request.path == _PATHS[-1] and hanging else 1})

    return small_device(described(dict.fromkeys(_PATHS, reading(_SCHEMA))), {path: {"GET": handle} for path in _PATHS})


@pytest.mark.parametrize("hanging", [_PATHS[:2], _PATHS[1:6]])
def test_what_hangs_is_named_and_the_others_are_judged(hanging, tmp_path):
    began = time.monotonic()
    with _device(hanging) as url:
        done = certified(f"{url}/openapi.json", tmp_path, "--timeout", "2")
    assert time.monotonic() - began < 120
    named = {one["operation"] for one in done.requirement("robustness/no-hang")["failures"][0]["operations"]}
    assert named == {f"GET {path}" for path in hanging}
    assert done.requirement("description/body-schema")["verdict"] == "fail"
    assert set(done.blamed) == {"robustness/no-hang", "description/body-schema"}, done.text
