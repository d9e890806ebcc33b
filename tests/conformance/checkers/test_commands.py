"""Commands on things, and whole documents: an effect that never comes, or that only the response shows, is blamed."""

import asyncio
import itertools
import re

import pytest
from aiohttp import web
from exchanges import broken, exchange
from small_device import (
    REFUSED,
    answers,
    body_of,
    certified,
    contract_of,
    described,
    error,
    object_of,
    reading,
    small_device,
)

_BASE = "http://device:8000"
_JOB = object_of(
    "id",
    "status",
    id={"type": "string"},
    status={"type": "string", "enum": ["queued", "idle", "running", "paused", "done", "cancelled"]},
    litres={"type": "number"},
    locked={"type": "boolean"},
)
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_DONE = {"200": answers(_JOB), "202": {"description": "later"}, "4XX": REFUSED}
_CHECKED = _DONE | {"200": answers(object_of("status", status={"type": "string"}))}
_READ, _STATES, _THERE = (f"description/{name}" for name in ("written-is-read", "states", "created-is-there"))
_ROW = object_of("row", row={"type": "integer"}, label={"type": "string"})
_TAKEN = {"201": answers(_ROW), "409": {**REFUSED, "description": "The row is taken in this bed"}}
_PATHS = {
    "/rows": {"post": {"requestBody": body_of(_ROW), "responses": _TAKEN}},
    "/rows/{id}": {"parameters": [_ID], **reading(_ROW), "delete": {"responses": {"204": {"description": ""}}}},
    "/jobs/{id}": {"parameters": [_ID], **reading(_JOB), "put": {"requestBody": body_of(_JOB), "responses": {
        "200": answers(_JOB), "201": answers(_JOB), "4XX": REFUSED,
    }}},
    **{
        f"/jobs/{{id}}/{name}": {"parameters": [_ID], "post": {
            "summary": text,
            "responses": _CHECKED if name == "check" else _DONE,
        }}
        for name, text in (
            ("cancel", "Cancel it"), ("lock", "Lock it"), ("unlock", "Unlock it"), ("fill", "Fill it up"),
            ("pause", "It pauses when it can"), ("check", "Check it"), ("start", "Start it"), ("stop", "Stop it"),
            ("launch", "A queued job becomes running. In every other status: 409."),
        )
    },
}  # fmt: skip


@pytest.fixture(name="contract", scope="module")
def _contract(tmp_path_factory):
    return contract_of(tmp_path_factory.mktemp("pack"), described(_PATHS, "3.1.0"))


def _get(after_s=0.1, **members):
    return after_s, "GET", "", 200, {"id": "1", "status": "queued", "locked": False, "litres": 1, **members}


def _do(name, code=200, **told):
    return 0.1, "POST", f"/{name}", code, {"id": "1", "status": "queued", "locked": False, "litres": 1, **told}


def _broken(contract, steps):
    moments = itertools.accumulate((after_s for after_s, *_ in steps), initial=1000.0)
    exchanges = [
        exchange(method, f"{_BASE}/jobs/1{below}", status, seen, at_s=now)
        for now, (_, method, below, status, seen) in zip(itertools.islice(moments, 1, None), steps, strict=True)
    ]
    return broken(contract, _BASE, exchanges) & {_READ, _STATES, _THERE}


@pytest.mark.parametrize(
    ("steps", "blamed"),
    [
        ([_get(), _do("cancel"), _get(), _get(4)] * 2, {_STATES}),
        ([_get(), _do("cancel"), _get(), _get(4)], set()),  # once may be chance
        ([_get(), _do("cancel"), _get(), _get(1, status="cancelled")], set()),
        ([_get(), _do("cancel"), _get(1, status="done")] * 2, {_STATES}),
        ([_get(status="done"), _do("cancel", status="done"), _get(4, status="done")], set()),
        ([_get(), _do("cancel", code=202), _get(4)] * 2, set()),
        ([_get(), _do("lock"), _get(4)] * 2, {_STATES}),
        ([_get(), _do("unlock"), _get(4)] * 2, set()),
        ([_get(), _do("lock"), _do("fill"), _get(4)] * 2, set()),  # two at once: neither is judged
        ([_get(), _do("pause"), _get(4)] * 2, set()),
        ([_get(status="idle"), _do("start", status="idle"), _get(4, status="idle")] * 2, {_STATES}),
        ([_get(status="idle"), _do("start"), _get(status="done")] * 2, set()),
        ([_get(), _do("start"), _get(4)] * 2, set()),  # what is queued may wait
        ([_get(), _do("launch"), _get(status="running")] * 2, {_STATES}),  # the response shows the state before
        ([_get(), _do("launch"), _get(status="running")], set()),  # once
        ([_get(), _do("launch"), _get(4, status="running")] * 2, set()),  # later
        ([_get(), _do("launch", status="running"), _get(status="running")] * 2, set()),
        ([_get(), _do("launch", status="running"), _get(status="done")] * 2, set()),
        ([_get(), _do("launch"), _get(4)] * 2, {_STATES}),
        ([_get(), _do("launch", status="idle"), _get(status="idle")] * 2, {_STATES}),
        ([_get(status="running"), _do("stop", status="running"), _get(4, status="running")] * 2, {_STATES}),
        ([_get(status="running"), _do("stop"), _get(4, status="idle")] * 2, set()),
        ([_get(), _do("fill", litres=9), _get(4)] * 2, {_READ}),
        ([_get(), _do("fill", litres=9), _get(4, litres=9)] * 2, set()),
        ([_get(), _do("fill", litres=9, id="2"), _get(4)] * 2, set()),  # another thing
        ([_get(), _do("check", status="ok"), _get(4)] * 2, set()),  # the outcome of the command itself
        # What changes by itself tells nothing.
        ([_get(litres=1), _get(litres=2), _do("fill", litres=9), _get(4, litres=2)] * 2, set()),
    ],
)
def test_the_effect_of_a_command(contract, steps, blamed):
    assert _broken(contract, steps) == blamed


@pytest.mark.parametrize(
    ("steps", "blamed"),
    [
        (["POST 1", "POST 1", "POST 1"], {_STATES}),
        (["POST 1", "POST 1"], set()),  # once, the first one may have ended by itself
        (["POST 1", "POST 2", "POST 3"], set()),
        (["POST 1", "DELETE", "POST 1", "DELETE", "POST 1"], set()),
    ],
)
def test_a_value_that_the_description_of_a_409_calls_taken(contract, steps, blamed):
    exchanges = []
    for number, step in enumerate(steps):
        method, _, number_of_row = step.partition(" ")
        row = {"row": int(number_of_row), "label": f"{number}"} if method == "POST" else None
        at = ("/rows", 201) if row else ("/rows/1", 204)
        exchanges.append(exchange(method, _BASE + at[0], at[1], row, sent=row, at_s=1000.0 + number))
    assert broken(contract, _BASE, exchanges) & {_STATES} == blamed


_OCTETS, _NOTES = {"type": "string", "format": "binary"}, {"type": "array", "items": {"type": "string", "minLength": 1}}
_PUMP, _ZONE = object_of("enabled", enabled={"type": "boolean"}), object_of("wet", wet={"type": "integer"})
_GAIN = {"type": "integer", "minimum": 1, "maximum": 90}
_ORDER = object_of("litres", litres={"type": "number", "minimum": 0, "maximum": 50})
_SWITCHED, _STORED = {"200": answers(_PUMP), "4XX": REFUSED}, {"204": {"description": "stored"}, "4XX": REFUSED}
_ACTED = {"200": answers(_JOB), "4XX": REFUSED}
_DEVICE = {
    "/pump": reading(_PUMP),
    "/pump/enable": {"post": {"summary": "Switch it on", "responses": _SWITCHED}},
    "/pump/disable": {"post": {"summary": "Switch it off", "responses": _SWITCHED}},
    "/jobs": {"post": {"requestBody": body_of(_ORDER), "responses": {"202": answers(_JOB), "4XX": REFUSED}}},
    "/jobs/{id}": {"parameters": [_ID], **reading(_JOB)},
    **{
        f"/jobs/{{id}}/{name}": {"parameters": [_ID], "post": {"summary": text, "responses": _ACTED}}
        for name, text in (("cancel", "Cancel a job"), ("start", "Start a job"), ("pause", "Pause a running job"))
    },
    "/notes": {**reading(_NOTES), "put": {"requestBody": body_of(_NOTES), "responses": _STORED}},
    "/photo": {
        "get": {"responses": {"200": answers(_OCTETS, "application/octet-stream")}},
        "put": {"requestBody": body_of(_OCTETS, "application/octet-stream"), "responses": _STORED},
    },
    "/settings/gain": {**reading(_GAIN), "put": {"requestBody": body_of(_GAIN), "responses": _STORED}},
    "/zones": reading({"type": "array", "items": {"type": "string"}}),
    "/zones/{id}": {
        "parameters": [_ID],
        **reading(_ZONE),
        "put": {
            "requestBody": body_of(_ZONE),
            "responses": {"200": answers(_ZONE), "201": answers(_ZONE), "4XX": REFUSED},
        },
        "delete": {"responses": _STORED},
    },
}


class _Garden:
    """A pump with jobs, notes, a photo and zones, and some faults."""

    def __init__(self, faults):
        self.faults, self.ids, self.jobs = faults, itertools.count(1), {}
        self.notes, self.photo, self.zones, self.is_on = ["a"], b"none", {"a": 1}, False
        self.gained = 7

    async def pump(self, request):
        if request.method == "POST":
            value = request.path.endswith("enable")
            self.is_on = value and "enable does nothing" not in self.faults
            return web.json_response({"enabled": value})
        return web.json_response({"enabled": self.is_on})

    async def begin(self, request):
        body = await _json(request)
        litres = body.get("litres") if isinstance(body, dict) else None
        if isinstance(litres, bool) or not isinstance(litres, int | float) or not 0 <= litres <= 50:
            return error(422, "litres")
        job = {"id": f"j{next(self.ids)}", "status": "queued", "litres": litres * ("litres lost" not in self.faults)}
        self.jobs[job["id"]] = job
        asyncio.get_running_loop().call_later(0.8, self.end, job)
        return web.json_response(job, status=202, headers={"Location": f"/jobs/{job['id']}"})

    def end(self, job):
        job["status"] = "done" if job["status"] == "queued" else job["status"]

    async def job(self, request):
        job, verb = self.jobs.get(request.match_info["id"]), request.path.rpartition("/")[2]
        before, after = {"start": ("queued", "running"), "pause": ("running", "paused")}.get(
            verb, ("queued", "cancelled")
        )
        if job is None or (request.method == "POST" and job["status"] != before):
            return error(409 if job else 404, f"no job, or not {before}")
        if request.method == "POST" and f"{verb} does nothing" not in self.faults:
            job["status"] = after
        return web.json_response(job)

    async def put_notes(self, request):
        body = await _json(request)
        if not isinstance(body, list) or not all(isinstance(one, str) and one for one in body):
            return error(422, "texts")
        self.notes = [*self.notes, *body] if "notes are added" in self.faults else body
        return web.Response(status=204)

    async def picture(self, request):
        if request.method == "PUT":
            octets = await request.read()
            self.photo = self.photo if "photo is kept" in self.faults else octets
            return web.Response(status=204)
        return web.Response(body=self.photo, content_type="application/octet-stream")

    async def gain(self, request):
        body = await _json(request) if request.method == "PUT" else self.gained
        if isinstance(body, bool) or not isinstance(body, int) or not 1 <= body <= 90:
            return error(422, "no gain")
        self.gained = min(body, 60) if "gain is limited" in self.faults else body
        return web.Response(status=204) if request.method == "PUT" else web.json_response(body)

    async def put_zone(self, request):
        body, name = await _json(request), request.match_info["id"]
        if not isinstance(body, dict) or not isinstance(body.get("wet"), int) or isinstance(body["wet"], bool):
            return error(422, "wet")
        is_new = name not in self.zones and "created with 200" not in self.faults
        self.zones[name] = body["wet"]
        return web.json_response({"wet": body["wet"]}, status=201 if is_new else 200)

    async def zone(self, request):
        name = request.match_info["id"]
        if name not in self.zones:
            return error(404, "no such zone")
        if request.method == "DELETE":
            del self.zones[name]
            return web.Response(status=204)
        return web.json_response({"wet": self.zones[name]})

    async def all_of(self, request):
        return web.json_response(self.notes if request.path == "/notes" else sorted(self.zones))

    @property
    def routes(self):
        return {
            "/pump": {"GET": self.pump}, "/pump/enable": {"POST": self.pump}, "/pump/disable": {"POST": self.pump},
            "/jobs": {"POST": self.begin}, "/jobs/{id}": {"GET": self.job}, **{
                f"/jobs/{{id}}/{verb}": {"POST": self.job} for verb in ("cancel", "start", "pause")
            },
            "/notes": {"GET": self.all_of, "PUT": self.put_notes}, "/zones": {"GET": self.all_of},
            "/settings/gain": {"GET": self.gain, "PUT": self.gain},
            "/photo": {"GET": self.picture, "PUT": self.picture},
            "/zones/{id}": {"GET": self.zone, "PUT": self.put_zone, "DELETE": self.zone},
        }  # fmt: skip


async def _json(request):
    try:
        return await request.json()
    except ValueError:
        return None


#: Faults of one device, each with what the failure that it causes names.
_FAULTS = (
    {},
    {
        "enable does nothing": "/pump",
        "litres lost": "/jobs",
        "notes are added": "/notes",
        "created with 200": "/zones/",
    },
    {"photo is kept": "/photo", "gain is limited": "/settings/gain", "pause does nothing": "/pause"},
    {"cancel does nothing": "/cancel"},
)


@pytest.mark.parametrize("faults", _FAULTS)
def test_commands_and_whole_documents_of_a_device(tmp_path, faults):
    garden = _Garden(faults)
    with small_device(described(_DEVICE, "3.1.0"), garden.routes) as url:
        selected = ("--select", "description") if faults else ()
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*", *selected)
    failures = re.findall(r"^\d+\. FAIL .*?^  Sent (.*?)$", seen.text, re.MULTILINE | re.DOTALL)
    assert {name: any(name in failure for failure in failures) for name in faults.values()} == dict.fromkeys(
        faults.values(), True
    ), seen.text
    assert {id_ for id_, verdict in seen.blamed.items() if verdict == "fail"} <= {_READ, _STATES, _THERE}, seen.text
    if not faults:
        # What a client had there before is there again, and nothing else.
        assert failures == []
        assert (garden.notes, garden.photo, garden.zones, garden.gained) == (["a"], b"none", {"a": 1}, 7)
