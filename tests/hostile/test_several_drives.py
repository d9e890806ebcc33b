"""A run that moved several drives, each with a stop of its own, stops all of them, also when its token has expired."""

import json
import subprocess
import threading

import msgspec
import pytest
from aiohttp import web
from processes import Begun
from small_device import REFUSED, answers, described, error, small_device

from conformance.contract.described import MOTION
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, empty_statement
from conformance.target.describing import described_contract
from conformance.transport.client import Connection
from conformance.verdict.run import Run

_ARM = {"name": "arm", "in": "path", "required": True, "schema": {"type": "string", "enum": ["left", "right"]}}
_SPEED = {"type": "object", "properties": {"speed": {"enum": [1, 2]}}, "required": ["speed"]}
_DONE = {"200": answers({"type": "object"}), "4XX": REFUSED}


class _Arms:
    """Two arms, each with a stop of its own, behind a login whose tokens all expire when both of them move."""

    description = described(
        {
            "/login": {"post": {"responses": {"200": answers({"type": "object"})}}},
            "/arms/{arm}/speed": {
                "post": {
                    "security": [{"token": []}],
                    "parameters": [_ARM],
                    "requestBody": {"required": True, "content": {"application/json": {"schema": _SPEED}}},
                    "responses": _DONE,
                }
            },
            "/arms/{id}/stop": {
                "post": {
                    "x-roaas-stop": True,
                    "security": [{"token": []}],
                    "parameters": [{"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}],
                    "responses": _DONE,
                }
            },
        },
        components={"securitySchemes": {"token": {"type": "http", "scheme": "bearer"}}},
    )

    def __init__(self) -> None:
        self.moving, self.logins, self.is_expired = set[str](), 0, False
        self.both_move, self.at_rest = threading.Event(), threading.Event()

    @property
    def routes(self):
        return {
            "/login": {"POST": self._login},
            "/arms/{arm}/speed": {"POST": self._drive},
            "/arms/{arm}/stop": {"POST": self._stop},
        }

    async def _login(self, _):
        self.logins, self.is_expired = self.logins + 1, False
        return web.json_response({"tokens": [f"t0ken-of-login-{self.logins}"]})

    def _refusal(self, request):
        if self.is_expired or request.headers.get("Authorization") != f"Bearer t0ken-of-login-{self.logins}":
            return error(401, "log in", **{"WWW-Authenticate": "Bearer"})
        return None if request.match_info["arm"] in {"left", "right"} else error(404, "no such arm")

    async def _drive(self, request):
        if (refused := self._refusal(request)) is not None:
            return refused
        try:
            speed = json.loads(await request.read())["speed"]
        except (ValueError, KeyError, TypeError):
            return error(400, "no speed")
        if speed not in (1, 2):
            return error(422, "no such speed")
        self.moving.add(request.match_info["arm"])
        if self.moving == {"left", "right"}:
            self.is_expired = True
            self.both_move.set()
        return web.json_response({})

    async def _stop(self, request):
        if (refused := self._refusal(request)) is not None:
            return refused
        self.moving.discard(request.match_info["arm"])
        if not self.moving and self.both_move.is_set():
            self.at_rest.set()
        return web.json_response({})


@pytest.mark.parametrize("is_killed", [True, False], ids=["killed", "ends by itself"])
def test_each_drive_is_stopped_although_the_token_has_expired(is_killed, tmp_path):
    device, statement = _Arms(), tmp_path / "device.toml"
    with small_device(device.description, device.routes) as url:
        statement.write_text(
            f"""api.openapi = "{url}/openapi.json"
calls.allow = ["POST /arms/*"]
auth = {{ login = "POST /login", token = "/tokens/0", send_as = "bearer" }}
""",
            encoding="utf-8",
        )
        words = ("certify", statement, "--effort", "quick", "--out", tmp_path / "out")
        with Begun(*words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            assert device.both_move.wait(120)
            if is_killed:
                process.kill()
            said, _ = process.communicate(timeout=120)
            assert device.at_rest.wait(60), said
    assert "the robot may still move" not in said


@pytest.mark.parametrize(("status", "at_rest"), [(200, 409), (400, 404), (409, 200), (422, 204)])
def test_a_drive_that_moves_although_the_device_refused_it_is_stopped(status, at_rest, tmp_path):
    """The newest drives that were refused are stopped as well; a device that did not move refuses these stops."""
    moving, stops = set[str](), []

    async def drive(request):
        moving.add(request.match_info["arm"])
        return error(status, "no") if status >= 400 else web.json_response({})

    async def stop(request):
        stops.append(arm := request.match_info["arm"])
        if arm not in moving:
            return error(at_rest, "it does not move") if at_rest >= 400 else web.Response(status=at_rest)
        moving.discard(arm)
        return web.json_response({})

    routes = {"/arms/{arm}/speed": {"POST": drive}, "/arms/{arm}/stop": {"POST": stop}}
    with small_device(_Arms.description, routes) as url:
        contract, where, _ = described_contract(
            f"{url}/openapi.json", (), None, Endpoints(), Connection(), tmp_path, mapped={MOTION}
        )
        statement = msgspec.structs.replace(empty_statement(contract), endpoints=where, calls=Calls(("*",)))
        run = Run(statement, contract, allow_motion=True, stop_s=0.5)
        robot = RobotUnderTest(run, Connection())
        robot.connect()
        for arm in "left", "right":
            robot.rest.client.send("POST", f"/arms/{arm}/speed")
        robot.is_at_rest = False
        robot.leave_at_rest()
    assert moving == set()
    assert {"left", "right"} <= {*stops}
    assert run.stop_undelivered == ""
