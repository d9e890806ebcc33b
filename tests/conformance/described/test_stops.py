"""What a description marks as a stop is sent at the end of a run that has called what moves, and only then."""

import json
import sys

import pytest
from processes import ended
from serving_apps import serving_app
from starlette.applications import Starlette
from starlette.responses import JSONResponse
from starlette.routing import Route

_JSON = {"application/json": {"schema": {"type": "object"}}}
_OK = {"200": {"description": "", "content": _JSON}}
_ID = {"name": "move_id", "in": "query", "required": True, "schema": {"type": "string"}}


class _Rover:
    """A device whose moves have ids; it notes what changes it."""

    def __init__(self):
        self.called = []

    def app(self):
        return Starlette(
            routes=[
                Route("/openapi.json", self.description),
                Route("/state", lambda _: JSONResponse({"moves": len(self.called)})),
                Route("/go", self.go, methods=["POST"]),
                Route("/halt", self.halt, methods=["POST"]),
            ]
        )

    async def description(self, _):
        paths = {
            "/state": {"get": {"responses": _OK}},
            "/go": {"post": {"responses": _OK}},
            "/halt": {"post": {"parameters": [_ID], "responses": _OK, "x-roaas-stop": True}},
        }
        return JSONResponse({"openapi": "3.1.0", "info": {"title": "Rover", "version": "1"}, "paths": paths})

    async def go(self, _):
        self.called.append("go")
        return JSONResponse({"move_id": f"m{len(self.called)}"})

    async def halt(self, request):
        self.called.append(f"halt {request.query_params.get('move_id')}")
        return JSONResponse({})


@pytest.mark.parametrize("calls", [True, False])
def test_a_stop_comes_last_with_the_newest_id_and_only_after_calls(calls, tmp_path):
    rover, more = _Rover(), ["--call", "POST /go"] if calls else []
    with serving_app(rover.app()) as url:
        done = ended(sys.executable, "-m", "roaas", "certify", url, "--effort", "quick", "--out", str(tmp_path), *more)
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["verdict"] == "conformant", done.stdout
    if not calls:
        assert rover.called == []
        return
    assert "Sends at the end, to stop the device (x-roaas-stop): POST /halt" in done.stderr
    first = next(index for index, one in enumerate(rover.called) if one.startswith("halt"))
    assert {one.partition(" ")[0] for one in rover.called[first:]} == {"halt"}
    newest = max(index for index, one in enumerate(rover.called[:first]) if one == "go") + 1
    assert rover.called[first] == f"halt m{newest}"
