"""What `certify --init` writes holds no secret, and no text of a device becomes a line of the statement's own."""

import http.server
import json
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from echoing_device import ENCODINGS, leaks
from origin_servers import document, serving
from processes import ended

_LINES = 'evil"\'\'\'\n[endpoints]\nrest = "http://elsewhere.example"\n[calls]\nallow = ["*"]\n#'
_ENDS = ("\n", "\r\n", "\r", "\x0b", "\x85", "\u2028", "$(touch x)`touch x`;", ']\n[calls]\nallow=["*"]\n', '"""')
_TOKEN, _KEY, _LEASE = "1nit-tok3n/of+this", "k3y of&th1s", "lea53-of-m1ne"


def _described(evil: str) -> dict[str, Any]:
    """Return a description with a text in each place that a statement is made of."""
    number = {"type": "number", "minimum": -1, "maximum": 1}
    wrong = {"type": "number", "minimum": evil, "maximum": f"0{evil}", "default": evil}
    body = {
        "type": "object",
        "required": ["x", "y", "mode", evil],
        "properties": {"x": number, evil: number, "mode": {"type": "string", "default": evil}, "z": wrong},
    }
    content = {"application/json": {"schema": body}}
    state = {"type": "object", "properties": {"x": number, evil: number, f"stamp{evil}": {"type": "string"}}}
    asked = {"name": evil, "in": "query", "required": True, "schema": {"type": "string"}, "description": evil}
    answer = {"200": {"description": evil, "content": {"application/json": {"schema": state}}}}
    acts = {"operationId": evil, "tags": [evil], "summary": evil, "requestBody": {"content": content}}
    return {
        "openapi": "3.0.3",
        "info": {"title": evil, "version": evil, "description": evil},
        "servers": [{"url": f"/{evil}"}],
        "paths": {
            "/state": {"get": {"responses": answer, "operationId": f"read{evil}"}},
            "/found": {"get": {"parameters": [asked], "responses": answer}},
            "/goto": {"post": {**acts, "responses": {"200": {"description": evil}}}},
            f"/goto/stop{evil}": {"post": {**acts, "operationId": "stop", "responses": {"200": {"description": ""}}}},
            f"/velocity{evil}": {"post": {**acts, "operationId": "v", "responses": {"200": {"description": ""}}}},
        },
        "components": {"securitySchemes": {evil: {"type": evil, "scheme": evil, "in": evil, "name": evil}}},
    }


def _init(folder: Path, *words: object) -> tuple[dict[str, Any], str]:
    """Write a statement; return its tables without the names of the device, and what the command said."""
    done = ended(sys.executable, "-m", "roaas", "certify", "--init", folder / "robot.toml", *words, cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    text = (folder / "robot.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    return tables, done.stdout + done.stderr


@pytest.mark.parametrize("evil", [_LINES, "".join(_ENDS)])
def test_no_text_of_a_description_becomes_a_line(tmp_path, evil):
    (tmp_path / "api.json").write_text(json.dumps(_described(evil)), encoding="utf-8")
    tables, _ = _init(tmp_path, tmp_path / "api.json")
    assert "# [motion.goto]" in (tmp_path / "robot.toml").read_text(encoding="utf-8")
    assert tables["api"] == {"openapi": "api.json"}
    assert tables["calls"] == {"allow": [], "never": []}
    assert (tables["endpoints"], tables["values"]) == ({}, {})
    assert tables.keys() == {"robot", "api", "endpoints", "calls", "values"}
    assert tables["robot"].keys() == {"name", "vendor", "version"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["api.json", "robot.toml"]


def test_no_secret_of_the_run_is_in_a_statement(tmp_path):
    for name, text in {"token": _TOKEN, "key": _KEY, "headers": f"X-Lease: {_LEASE}"}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")

    def echo(handler: http.server.BaseHTTPRequestHandler) -> None:
        sent = " ".join((handler.path, *map(str, map(handler.headers.get, ("Authorization", "X-Lease")))))
        evil = " ".join(write(sent) for name, write in ENCODINGS.items() if name != "utf_16")
        document({**_described(sent), "info": {"title": sent, "version": evil}})(handler)

    with serving({"/openapi.json": echo}) as device:
        options = ["--token-file", "token", "--api-key", "query key", "--api-key-file", "key"]
        tables, said = _init(tmp_path, f"{device.url}/openapi.json", *options, "--headers-file", "headers")
        papers = ended(
            *(sys.executable, "-m", "roaas", "certify", "--init", "papers.toml", "--rest", device.url),
            *("--token-file", "token", "--publishers-wsdl", f"{device.url}/openapi.json"),
            cwd=tmp_path,
        )
    assert "$ROAAS_TOKEN" in tables["robot"]["name"], "the device was given it"
    tomllib.loads((tmp_path / "papers.toml").read_text(encoding="utf-8"))
    for given in ("token", "key", "headers"):
        (tmp_path / given).unlink()
    assert leaks(tmp_path, [_TOKEN, _KEY, _LEASE], said, papers.stdout, papers.stderr) == []
