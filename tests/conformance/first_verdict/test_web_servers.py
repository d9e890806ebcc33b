"""What a web server's parser does is told once, beside the verdict on the API."""

import re

import pytest
from aiohttp import web
from serving import CALL, serving
from serving_apps import behind_nginx
from small_device import answers, body_of, certified, described, error, object_of, small_device

from conformance.explaining.advice import topic_of

# What these servers do in the versions of constraints.txt.
_NOT_MET = {
    "uvicorn, h11": {"host-invalid", "absolute-form", "length-and-chunks-closed"},
    "uvicorn, httptools": {"host-invalid", "host-missing"},
    "gunicorn, sync": {"host-invalid", "host-missing", "target-length"},
    "Werkzeug": {
        "host-invalid",
        "host-missing",
        "content-length-conflict",
        "space-before-colon",
        "malformed-request",
        "target-form",
        "chunk-forms",
    },
    "aiohttp": {"host-invalid"},
    "http.server": None,
    "Node http": None,
    "nginx before gunicorn, sync": {"target-length"},
}
# On these the POST is sent too.
_POSTED = {"gunicorn, sync", "Werkzeug", "Node http"}


@pytest.mark.parametrize("server", _NOT_MET)
def test_a_right_api_keeps_its_description_on_every_server(server, tmp_path):
    with serving(server) as url:
        outcome = certified(f"{url}/openapi.json", tmp_path, *(CALL if server in _POSTED else ()))
    assert (outcome.exit_code, outcome.blamed) == (0, {})
    beside = outcome.result["web_server"]
    not_met = {one["id"].partition("/")[2] for one in beside["requirements"] if one["verdict"] in {"fail", "warn"}}
    assert _NOT_MET[server] in {None, frozenset(not_met)}
    assert f"Its web server, {beside['server']} by its Server field" in outcome.text or not beside["server"]
    assert "web-server" not in outcome.result["classes"]
    assert all(f"web-server/{name}" in beside["text"] for name in not_met)
    pages = {name: (tmp_path / name).read_text(encoding="utf-8") for name in ("certificate.html", "certificate.md")}
    assert all("Its web server, " in page for page in pages.values())
    assert "web-server" not in (tmp_path / "junit.xml").read_text(encoding="utf-8")


def test_a_claim_makes_the_web_server_decide(tmp_path):
    with serving("uvicorn, httptools") as url:
        asked = certified(f"{url}/openapi.json", tmp_path / "asked", "--class", "web-server")
        other = certified(f"{url}/openapi.json", tmp_path / "other", "--class", "http")
    assert (asked.exit_code, asked.result["classes"]) == (1, {"web-server": "fail"} | asked.result["classes"])
    assert asked.blamed == {"web-server/host-missing": "fail", "web-server/host-invalid": "fail"}
    assert "web_server" not in asked.result
    assert other.exit_code == 0
    assert "web_server" not in other.result


@pytest.mark.parametrize(("server", "framework"), [("uvicorn, httptools", "fastapi"), ("gunicorn, sync", "flask")])
def test_the_advice_makes_each_rule_pass(server, framework, tmp_path):
    topic = topic_of("web-server/host-missing")
    assert topic is not None
    place = re.search(r"`(location .*?)`", topic.fix)
    command = topic.code[framework].strip().splitlines()[-1]
    assert place is not None
    assert command.split()[0] in server
    options = re.findall(r"--limit\S+ \S+", command)
    with serving(server, *" ".join(options).split()) as upstream:
        advised = place[1].replace("http://127.0.0.1:7004", upstream)
        with behind_nginx(upstream, "", tmp_path, place=advised) as url:
            claims = ("--class", "web-server", "--class", "http")
            outcome = certified(f"{url}/openapi.json", tmp_path / "out", *claims, *CALL)
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text


@pytest.mark.parametrize("status", [400, 500])
def test_a_server_that_reads_no_chunks_is_told_that(status, tmp_path):
    size = object_of("size", size={"type": "integer"})

    async def put(request: web.Request) -> web.Response:
        if "Transfer-Encoding" in request.headers:  # as Django does behind gunicorn, and Werkzeug for an extension
            return error(status, "no content")
        if (text := await request.text()).startswith("[[[["):
            return error(500, "no content")
        return web.json_response({"size": 1}) if re.fullmatch(r'{"size": ?\d+}\s*', text) else error(400, "no size")

    item = {"put": {"requestBody": body_of(size), "responses": {"200": answers(size), "4XX": {"description": "no"}}}}
    with small_device(described({"/size": item}), {"/size": {"PUT": put}}) as url:
        outcome = certified(f"{url}/openapi.json", tmp_path, "--call", "*")
    told = next(one for one in outcome.result["web_server"]["requirements"] if one["id"] == "web-server/chunk-forms")
    assert (told["verdict"], "comes as chunks with nothing else" in told["reason"]) == ("fail", True), told
