"""``--minutes`` bounds a run; what it left out is named, and is neither passed nor an error."""

import asyncio
import re
from pathlib import Path

from aiohttp import web
from camera import Camera
from small_device import Handle, answers, certified, constant, described, reading, small_device

_COUNT = 25
_MINUTES = 0.1
_SCHEMA = {"type": "object", "required": ["value"], "properties": {"value": {"type": "integer"}}}


async def _slow(_: web.Request) -> web.Response:
    await asyncio.sleep(0.06)
    return web.json_response({"value": 1})


def test_many_slow_operations_are_each_called_before_any_is_varied(tmp_path: Path) -> None:
    paths = {f"/value{number}": reading(_SCHEMA) for number in range(_COUNT)}
    routes = {path: {"GET": _slow} for path in paths}
    with small_device(described(paths), routes) as url:
        done = certified(url, tmp_path, "--minutes", _MINUTES, effort="standard")
    assert done.result["duration_s"] < 60 * _MINUTES + 10
    left = done.result["left_out"]
    assert left["operations"] == []
    assert len(left["fewer"]) == _COUNT
    verdicts = {one["id"]: one["verdict"] for one in done.result["requirements"]}
    assert left["requirements"]
    assert {verdicts[id_] for id_ in left["requirements"] if id_ in verdicts} == {"skip"}
    assert done.blamed == {}
    assert "suite_errors" not in done.result
    for text in (done.text, (tmp_path / "certificate.html").read_text(), (tmp_path / "certificate.md").read_text()):
        assert f"--minutes {_MINUTES}: {_COUNT} operations got fewer requests" in text


def test_operations_that_were_not_called_are_named(tmp_path: Path) -> None:
    paths = {f"/value{number}": reading(_SCHEMA) for number in range(200)}
    routes = {path: {"GET": _slow} for path in paths}
    with small_device(described(paths), routes) as url:
        done = certified(url, tmp_path, "--minutes", _MINUTES)
    left = done.result["left_out"]
    assert 0 < len(left["operations"]) < 200
    assert f"--minutes {_MINUTES}: {len(left['operations'])} of 200 operations not called: GET /value" in done.text
    assert done.exit_code == 4
    assert done.blamed == {}


def _slowly(handle: Handle) -> Handle:
    async def slow(request: web.Request) -> web.StreamResponse:
        await asyncio.sleep(0.2)
        return await handle(request)

    return slow


def test_each_operation_of_a_slow_wsdl_is_called_before_any_gets_a_wrong_message(tmp_path: Path) -> None:
    routes = {
        path: {method: _slowly(handle) for method, handle in methods.items()}
        for path, methods in Camera().routes.items()
    }
    with small_device({}, routes) as url:
        done = certified(f"{url}/a/camera.wsdl", tmp_path, "--call", "Stop", "--minutes", _MINUTES)
    assert done.result["left_out"]["operations"] == []
    assert done.result["left_out"]["fewer"]
    assert done.blamed == {}
    assert "This run sends about" in done.text


def test_a_run_within_its_time_leaves_nothing_out_and_finds_the_same(tmp_path: Path) -> None:
    paths = {
        "/good": reading(_SCHEMA),
        "/bad": reading({"type": "object", "required": ["missing"]}),
        "/text": {"get": {"responses": {"200": answers({"type": "string"})}}},
    }
    routes = {"/good": constant({"value": 1}), "/bad": constant({}), "/text": constant("a")}
    with small_device(described(paths), routes) as url:
        free = certified(url, tmp_path / "free")
        bounded = certified(url, tmp_path / "bounded", "--minutes", 5)
    assert "left_out" not in bounded.result
    told = re.search(r"This run sends about ([\d,]+) requests and takes about .* \(the device answers in", free.text)
    assert told is not None
    assert free.result["requests"] / 1.5 < int(told[1].replace(",", "")) < free.result["requests"] * 1.5
    assert "It ends after about 5 minutes." in bounded.text
    assert bounded.exit_code == free.exit_code == 1
    assert bounded.blamed == free.blamed
