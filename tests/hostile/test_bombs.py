"""A bomb in a description: each command says what is too large and where, in little memory, and hears Ctrl-C."""

import json
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest
from aiohttp import web
from processes import Begun, ended
from small_device import Handle, certified, constant, described, error, reading, small_device

_MOST_MB = 500
_LAUGHS = "".join(f"x{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 15))
#: Descriptions by their files' names, and what is said of them.
REFUSED = {
    "aliases.yaml": (f"openapi: 3.0.3\npaths: {{}}\nx0: &a0 [lol]\n{_LAUGHS}", "repeat, at line 9"),
    "text.yaml": (f"openapi: 3.0.3\npaths: {{}}\nx: &a {'a' * 10**6}\ny: [{'*a,' * 1000}]\n", "at line 4"),
    "deep.json": ('{"openapi": "3.0.3", "paths": ' + "[" * 100_000, "nested too deeply"),
    "values.json": ('{"openapi": "3.0.3", "x": [' + "0," * 1_100_000 + "0]}", "values, at #/x"),
    "name.json": ('{"openapi": "3.0.3", "x": {"' + "a" * 5_000_000 + '": 1}}', "a name has 5,000,000 characters"),
    "paths.json": (json.dumps(described({f"/{i}": {} for i in range(11_000)})), "the limit is 10,000"),
}  # fmt: skip
_COMMANDS = {
    "certify": ("certify", "{}", "--base-url", "http://127.0.0.1:1", "--out", "{out}"),
    "load": ("load", "{}", "--base-url", "http://127.0.0.1:1", "--operation", "GET /a", "--out", "{out}"),
    "diff": ("diff", "{}", "{}"),
}


# The commands read by the same reader: each meets the limit of each format.
_READ = [(name, "certify") for name in REFUSED]
_READ += [(name, command) for name in ("aliases.yaml", "values.json") for command in ("load", "diff")]


@pytest.mark.parametrize(("name", "command"), _READ)
def test_each_command_says_what_is_too_large(name: str, command: str, tmp_path: Path) -> None:
    text, reason = REFUSED[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    words = (word.format(tmp_path / name, out=tmp_path / "out") for word in _COMMANDS[command])

    done = ended(sys.executable, "-m", "roaas", *words, peak_mb=tmp_path / "peak")

    said = " ".join((done.stdout + done.stderr).split())
    assert "Traceback" not in said
    assert (done.returncode, reason in said) == (2, True), said
    assert int((tmp_path / "peak").read_text()) < _MOST_MB


def _ref(name: str) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{name}"}


def _net(kind: str, make: Any) -> dict[str, Any]:
    """Return twenty schemas, each of which is made from a reference to the next one."""
    return {**{f"{kind}{i}": make(_ref(f"{kind}{i + 1}")) for i in range(20)}, f"{kind}20": {"type": "string"}}


_SCHEMAS = {
    **_net("all", lambda part: {"allOf": [part] * 10}),
    **_net("one", lambda part: {"oneOf": [part, {"not": part}] * 3}),
    **_net("must", lambda part: {"required": ["a", "b", "c"], "properties": dict.fromkeys("abc", part)}),
    **_net("may", lambda part: {"type": "object", "properties": {f"p{i}": part for i in range(10)}}),
    "text": {"type": "string", "minLength": 10**9},
    "list": {"type": "array", "minItems": 10**7, "items": {"type": "integer"}},
    "words": {"type": "string", "pattern": "^(a{1000}){1000}$"},
    "step": {"type": "number", "multipleOf": 1e-300},
}


def test_a_device_with_schemas_that_unroll_without_end_is_judged_by_the_others(tmp_path: Path) -> None:
    bombs = ("all0", "one0", "must0", "may0", "text", "list", "words", "step")
    paths = {f"/{name}": reading(_ref(name)) for name in bombs}
    document = described({**paths, "/good": reading({"type": "string"})}, components={"schemas": _SCHEMAS})
    values = {"may0": {}, "step": 1, "good": "yes"}
    routes = {f"/{name}": constant(values.get(name, "a")) for name in (*bombs, "good")}

    with small_device(document, routes) as url:
        found = certified(f"{url}/openapi.json", tmp_path / "out", peak_mb=tmp_path / "peak")

    assert found.exit_code in {0, 4}, found.text
    assert "not judged: it is too large" in json.dumps(found.result)
    assert found.requirement("description/body-schema")["verdict"] == "pass"
    assert int((tmp_path / "peak").read_text()) < _MOST_MB


def _ring() -> dict[str, Any]:
    """Return 450 schemas, each of which refers to two others."""
    members = {f"member_{k}": {"type": "string", "description": "A member. " * 5} for k in range(30)}
    return {
        f"s{i}": {"properties": {**members, "a": _ref(f"s{(i + 1) % 450}"), "b": _ref(f"s{i * 7 % 450}")}}
        for i in range(450)
    }


def _large(place: str, value: Any) -> dict[str, Any]:
    """Return a description with something large in a place of its schema or its media type."""
    item = reading({"type": "string"})
    content = item["get"]["responses"]["200"]["content"]["application/json"]
    (content["schema"] if place == "schema" else content).update(value)
    return described({"/good": item})


def _posting(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a description with a body that a generator would make a case of for each part, with all the others."""
    good = reading({"type": "string"})
    responses = {"200": good["get"]["responses"]["200"], "4XX": {"description": "refused"}}
    body = {"required": True, "content": {"application/json": {"schema": schema}}}
    return described({"/good": good, "/a": {"post": {"requestBody": body, "responses": responses}}})


def _taking(document: dict[str, Any]) -> Handle:
    """Return a handler of ``POST /a`` that takes what its description allows, and refuses the rest."""
    bodies = document["paths"].get("/a", {}).get("post", {}).get("requestBody", {}).get("content", {}).values()
    takes = jsonschema_rs.validator_for(next(iter(bodies), {}).get("schema", {})).is_valid

    async def handle(request: web.Request) -> web.Response:
        if request.content_type != "application/json":
            return error(415, "no JSON")
        with suppress(ValueError):
            if takes(json.loads(await request.read())):
                return web.json_response("yes")
        return error(400, "not as described")

    return handle


#: Descriptions that are judged as others are, though they are large.
LARGE = {
    "ring": lambda: described(
        {"/good": reading({"type": "string"}), "/ring": reading(_ref("s0"))}, components={"schemas": _ring()}
    ),
    "example": lambda: _large("content", {"example": "a" * 20_000_000}),
    "pattern": lambda: _large("schema", {"pattern": "a" * 20_000_000}),
    "members": lambda: _posting({"properties": {f"p{i}": {"type": "integer"} for i in range(20_000)}}),
    "fewer members": lambda: _posting({"properties": {f"p{i}": {"type": "integer"} for i in range(900)}}),
    "alternatives": lambda: _posting({"oneOf": [{"enum": [i]} for i in range(4_000)]}),
}


@pytest.mark.parametrize("name", LARGE)
def test_a_large_description_is_judged_in_little_memory(name: str, tmp_path: Path) -> None:
    document = LARGE[name]()
    (tmp_path / "large.json").write_text(json.dumps(document), encoding="utf-8")
    routes = {path: constant("yes" if path == "/good" else {}) for path in document["paths"]}
    routes["/a"] = {"POST": _taking(document)}

    with small_device({}, routes) as url:
        words = ("--base-url", url, "--select", "description/body-schema", "--timeout", 60, "--call", "*")
        found = certified(tmp_path / "large.json", tmp_path / "out", *words, peak_mb=tmp_path / "peak")

    assert found.exit_code in {0, 4}, found.text
    assert found.requirement("description/body-schema")["verdict"] == "pass"
    assert int((tmp_path / "peak").read_text()) < _MOST_MB
    assert ("POST /a had no generated requests" in found.text) is (name in {"members", "alternatives"})


def test_reading_is_interrupted_by_ctrl_c(tmp_path: Path) -> None:
    lines = "".join(f"  k{i}: [a, b, {{c: 'text {i}'}}]\n" for i in range(150_000))
    (tmp_path / "large.yaml").write_text(f"openapi: 3.0.3\npaths: {{}}\nx:\n{lines}", encoding="utf-8")
    words = ("diff", tmp_path / "large.yaml", tmp_path / "large.yaml")
    with Begun(*words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        # It has begun to read when it has used some time of the processor.
        while process.poll() is None and _ticks(process.command_pid) < 20:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        began = time.monotonic()
        _, said = process.communicate(timeout=120)

    assert "Traceback" not in said
    assert process.returncode in {0, 130}, said  # 0: a machine so fast that it was read meanwhile
    assert time.monotonic() - began < 60


def _ticks(pid: int) -> int:
    """Return the processor time of a process, in hundredths of a second; what does not know it says enough."""
    path = Path(f"/proc/{pid}/stat")
    return sum(map(int, path.read_text().rpartition(")")[2].split()[11:13])) if path.exists() else 100
