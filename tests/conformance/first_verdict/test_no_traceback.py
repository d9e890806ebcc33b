"""Paths beyond ASCII, descriptions without GET or 2xx, closed streams, full disks: a verdict, or one sentence."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from aiohttp import web
from click.testing import CliRunner
from small_device import REFUSED, certified, constant, described, error, reading, small_device

import roaas

_OBJECT = {"type": "object"}


async def _nothing(_: web.Request) -> web.Response:
    return web.Response(status=204)


async def _refused(_: web.Request) -> web.Response:
    return error(401, "token", **{"WWW-Authenticate": "Bearer"})


def test_paths_that_http_cannot_carry_are_percent_encoded(tmp_path):
    paths = ("/greifer/höhe", "/greifer/lower limit", "/腕", "/a%20b", "/{name}/größe")
    routes = {path: constant({}) for path in paths}
    with small_device(described({path: reading(_OBJECT) for path in paths[:4]}), routes) as url:
        outcome = certified(f"{url}/openapi.json", tmp_path)
    assert (outcome.exit_code, outcome.blamed) == (0, {})
    assert outcome.result["api"]["coverage"]["operations"] == [4, 4]


@pytest.mark.parametrize("call", [(), ("--call", "*")])
def test_a_description_without_get_is_judged(tmp_path, call):
    post = {"post": {"responses": {"204": {"description": "moves"}, "4XX": REFUSED}}}
    with small_device(described({"/move": post}), {"/move": {"POST": _nothing}}) as url:
        outcome = certified(f"{url}/openapi.json", tmp_path, *call)
    assert outcome.exit_code in {0, 4}
    assert "error" not in outcome.blamed.values()


def test_formats_of_a_device_that_refuses_everything_are_not_seen(tmp_path):
    both = {"description": "ok", "content": {name: {"schema": _OBJECT} for name in ("application/json", "text/xml")}}
    state = {"get": {"responses": {"200": both, "401": REFUSED}}}
    with small_device(described({"/state": state}), {"/state": {"GET": _refused}}) as url:
        outcome = certified(f"{url}/openapi.json", tmp_path)
    assert outcome.exit_code == 4
    assert outcome.blamed == {}


@pytest.mark.parametrize("streams", [">&- 2>&-", "| head -c 1", ">/dev/full 2>/dev/full"])
def test_the_exit_code_is_the_verdict_whoever_reads_the_output(tmp_path, streams):
    with small_device(described({"/state": reading(_OBJECT)}), {"/state": constant({})}) as url:
        words = f"certify {url}/openapi.json --class description --effort quick --out {tmp_path}"
        command = f"set -o pipefail; {sys.executable} -m roaas {words} {streams}"
        done = subprocess.run(["bash", "-c", command], check=False, capture_output=True, text=True, timeout=100)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False)
    assert json.loads((tmp_path / "result.json").read_text())["verdict"] == "conformant"


def test_the_details_of_a_failure_are_kept(monkeypatch):
    def broken(**_: object) -> None:
        raise ValueError("odd")

    monkeypatch.setattr("conformance.cli.explain.explain.callback", broken)
    result = CliRunner().invoke(roaas.main, ["explain", "http/date"])
    path = Path(result.output.rsplit(" ", 1)[-1].strip().rstrip("."))
    assert "ValueError: odd" in path.read_text()
    path.unlink()
