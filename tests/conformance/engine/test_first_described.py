"""The first statement on a device with a description of its own."""

import json
import re
import tomllib

import pytest
from click.testing import CliRunner

from conformance.cli.certify import certify

API = {
    "openapi": "3.1.0",
    "info": {"title": 'The "arm"\n[claims]', "version": "2.1"},
    "servers": [{"url": "http://arm:8000/v1"}],
    "components": {"securitySchemes": {"key": {"type": "apiKey", "in": "header", "name": "X-Key"}}},
    "paths": {
        "/api/jobs/{job_id}": {
            "parameters": [{"name": "job_id", "in": "path", "required": True, "schema": {"type": "string"}}],
            "get": {"responses": {}},
            "delete": {"responses": {}},
        },
        "/api/firmware": {"post": {"responses": {}, "tags": ["update"]}},
        "/api/joints/{name}": {
            "get": {
                "parameters": [{"name": "name", "in": "path", "required": True, "schema": {"enum": ["a"]}}],
                "responses": {},
            }
        },
        "/health": {"get": {"responses": {}}},
        "/brake": {"put": {"responses": {}, "x-roaas-stop": True}},
        "/speed": {"put": {"responses": {}, "x-roaas-motion": True}},
    },
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "api.json").write_text(json.dumps(API))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(certify, list(arguments))


@pytest.mark.parametrize(
    "arguments",
    [
        ["--init", "arm.toml", "api.json"],
        ["api.json", "--init", "arm.toml"],
        ["--openapi", "api.json", "--init", "arm.toml"],
        ["arm.toml", "--init", "--openapi", "api.json"],
    ],
)
def test_the_statement_is_written_and_can_be_read(folder, arguments):
    done = run(*arguments)
    assert done.exit_code == 0, done.output
    text = (folder / "arm.toml").read_text()
    found = tomllib.loads(text)
    assert found == {
        "robot": {"name": 'The "arm"\n[claims]', "vendor": "", "version": "2.1"},
        "api": {"openapi": "api.json"},
        "endpoints": {},
        "calls": {"allow": [], "never": []},
        "values": {},
    }
    for line in (
        "# Called are 3 of 7 operations.",
        "  # -- jobs\n  # called: GET /api/jobs/{job_id}\n",
        '  # "DELETE /api/jobs/{job_id}",  # it may change something\n',
        '  # -- update\n  # "POST /api/firmware",  # its name, or a value of it, warns of harm\n',
        "  # -- health\n  # called: GET /health\n",
        "  # sent at the end, to stop the device: PUT /brake\n",
        '  # "PUT /speed",  # it may change something; it moves the device, so --allow-motion too\n',
        '# base_url = "http://arm:8000/v1"',
        '# "job_id" = []  # GET /api/jobs/{job_id}\n',
        "security scheme key: apiKey header X-Key.",
    ):
        assert line in text
    assert '"name" = []' not in text, "the description names its values"


def test_each_comment_can_become_a_line(folder):
    assert run("--init", "arm.toml", "api.json").exit_code == 0
    text = (folder / "arm.toml").read_text()
    for line in ('"POST /api/firmware"', '"DELETE /api/jobs/{job_id}"'):
        text = text.replace(f"  # {line}", f"  {line}")
    assert tomllib.loads(text.replace('# "job_id"', '"job_id"'))["calls"]["allow"] == [
        "DELETE /api/jobs/{job_id}", "POST /api/firmware",
    ]  # fmt: skip


def test_what_the_options_say_stands_in_it(folder):
    (folder / "token").write_text("sesame-opens-the-arm")
    options = ["--call", "DELETE /api/jobs/*", "--never", "update", "--base-url", "http://other"]
    options += ["--token-file", "token", "--timeout", "5"]
    assert run("--init", "arm.toml", "api.json", *options).exit_code == 0
    found = tomllib.loads((folder / "arm.toml").read_text())
    assert found["calls"] == {"allow": ["DELETE /api/jobs/*"], "never": ["update"]}
    assert found["api"]["base_url"] == "http://other"
    assert found["endpoints"] == {"token_file": "token", "timeout_s": 5.0}
    assert "# called: DELETE /api/jobs/{job_id}" in (folder / "arm.toml").read_text()


def test_what_is_commented_out_stands_in_its_table(folder):
    assert run("--init", "arm.toml", "api.json").exit_code == 0
    text = (folder / "arm.toml").read_text()
    on = re.sub(
        r"^# (?=\[auth\]|(?:ca_file|request_rate|timeout_s|login|body_file|token) )", "", text, flags=re.MULTILINE
    )
    read = tomllib.loads(on)
    assert read["endpoints"].keys() == {"ca_file", "request_rate", "timeout_s"}
    assert read["auth"].keys() == {"login", "body_file", "token"}


def test_files_are_named_from_where_the_statement_is(folder):
    (folder / "statements").mkdir()
    assert run("--init", "statements/arm.toml", "api.json").exit_code == 0
    assert tomllib.loads((folder / "statements" / "arm.toml").read_text())["api"]["openapi"] == "../api.json"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--init", "api.json"], "name the file"),
        (["--init", "arm.toml", "there.toml", "api.json"], "several statements"),
        (["--init", "arm.toml", "api.json", "--openapi", "api.json"], "several descriptions"),
        (["--init", "arm.toml", "nowhere.json"], "nowhere.json"),
        (["--init", "there.toml", "api.json"], "--force"),
    ],
)
def test_wrong_usage_is_told_and_writes_nothing(folder, arguments, said):
    (folder / "there.toml").write_text("")
    done = run(*arguments)
    assert (done.exit_code, said in done.output) == (2, True), done.output
    assert not (folder / "arm.toml").exists()
    assert (folder / "there.toml").read_text() == ""
