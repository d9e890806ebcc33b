"""One quick run finds faults that show under a condition alone, and blames no right device of another style."""

import json
import re

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, constant, described, error, reading, small_device
from wired_device import CALLS, wired_device

# Faults of one run, each with the requirement that it breaks and what a finding of it names.
_RUNS = (
    {
        "404 for actions": ("description/method-refused", "/seal"),
        "HEAD of items 404": ("description/head", "HEAD /tubes/"),
        "If-None-Match list": ("description/entity-tag", "If-None-Match"),
        "DELETE ignores If-Match": ("description/if-match", "DELETE /tubes/"),
        "unread after 415": ("robustness/recovers", "behind a refused"),
        "412 html": ("description/media-type", "text/html"),
        "16th wrong": ("description/body-schema", "/log"),
        "texts without combining marks": ("description/written-is-read", "name"),
        "texts without emoji": ("description/written-is-read", "/jobs"),
        "Allow of sub-resources": ("description/allow", "/label"),
    },
    {
        "OPTIONS of items 404": ("description/method-refused", "OPTIONS"),
        "HEAD with another ETag": ("description/head", '"head"'),
        "ETag without the level": ("description/entity-tag", "level"),
        "PUT ignores If-Match": ("description/if-match", "PUT /"),
        "unread after 404": ("robustness/recovers", "behind a refused"),
        "304 for any": ("http/preconditions", "304"),
        "405 schema": ("description/method-refused", "error"),
        "null after a refusal": ("description/body-schema", "/info"),
        "every 3rd Location is wrong": ("description/created-is-there", "/tubes"),
        "texts as Latin-1": ("description/written-is-read", "label"),
        "20th 500": ("robustness/no-server-error", "/health"),
    },
    {
        "404 for methods of sub-resources": ("description/method-refused", "/label"),
        "HEAD with query 400": ("description/head", "limit="),
        "304 for a weak only": ("description/entity-tag", "304"),
        "If-Match right refused": ("description/if-match", "412"),
        "unread large": ("robustness/recovers", "65,536"),
        "more after a refusal": ("description/body-schema", "/status"),
        "409 schema": ("description/body-schema", "409"),
        "no Location after a delete": ("description/headers", "/tubes"),
    },
    {
        "404 for methods of items": ("description/method-refused", "/tubes/"),
        "HEAD length": ("http/head-no-body", "sealed="),
        "412 for GET": ("description/entity-tag", "412"),
        "PATCH ignores If-Match": ("description/if-match", "PATCH /"),
        "415 schema": ("description/body-schema", "415"),
        "old ETag after a write": ("description/entity-tag", "old"),
        "length in characters": ("description/body-schema", ""),
    },
)


@pytest.mark.side_by_side
@pytest.mark.parametrize("faults", _RUNS, ids=range(1, len(_RUNS) + 1))
def test_faults_under_a_condition_are_found(faults, tmp_path):
    selected = [f"--select={id_}" for id_ in sorted({id_ for id_, _ in faults.values()})]
    with wired_device(faults) as url:
        done = certified(url, tmp_path / "out", *CALLS, *selected)
    missed = [
        name
        for name, (id_, text) in faults.items()
        if not any(text in json.dumps(one).replace('\\"', '"') for one in done.requirement(id_)["failures"])
    ]
    assert not missed, done.text


@pytest.mark.parametrize(
    "styles",
    [
        ("404 first", "closes after errors", "weak ETags", "weak If-Match", "no HEAD"),
        ("429 often",),
        ("gzip", "HEAD without length", "no If-Match", "no conditions", "404 for methods"),
    ],
)
def test_a_right_device_of_any_style_passes(styles, tmp_path):
    with wired_device(styles=styles) as url:
        done = certified(url, tmp_path / "out", *CALLS)
    assert (done.exit_code, done.blamed) == (0, {}), done.text
    assert not re.search("status 429|Got 429", done.text), done.text


@pytest.mark.parametrize("missing", [405, 404])
def test_what_the_device_has_named_is_asked_by_undeclared_methods(missing, tmp_path):
    axis = {"type": "object", "required": ["id"], "properties": {"id": {"type": "string"}}}
    key = {"parameters": [{"in": "path", "name": "axisId", "required": True, "schema": {"type": "string"}}]}
    act = {"post": {"responses": {"200": answers({}), "4XX": REFUSED}}}
    paths = {
        "/axes": reading({"type": "array", "items": axis}),
        "/axes/{axisId}": {**key, **reading(axis)},
        "/axes/{axisId}/home": {**key, **act},
        "/stop": act,
    }

    async def one(request: web.Request) -> web.Response:
        return web.json_response({"id": "x7"}) if request.match_info["axisId"] == "x7" else error(404, "no such axis")

    async def home(request: web.Request) -> web.Response:
        return error(409 if request.match_info["axisId"] == "x7" else 404, "not now")

    async def none(_: web.Request) -> web.Response:
        return error(missing, "no such thing", Allow="POST")

    routes = {
        "/axes": constant([{"id": "x7"}]),
        "/axes/{axisId}": {"GET": one},
        "/axes/{axisId}/home": {"POST": home, "GET": none},
        "/stop": {"POST": constant({})["GET"]},
    }
    with small_device(described(paths), routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "POST *")
    assert ("description/method-refused" in done.blamed) is (missing == 404), done.text
