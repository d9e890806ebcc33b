"""Jobs that go on and end, and racks in use: whatever is right is not blamed, and faults are found."""

import time

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, described, error, reading, small_device

_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_BAD = {"4XX": REFUSED}
_KEEPS, _FOLLOWS, _GONE = (f"description/{name}" for name in ("refused-keeps", "states", "deleted-is-gone"))
_STATES = ["queued", "running", "done", "cancelled"]


class _Jobs:
    """A device of jobs: style says what is free, fault what is wrong."""

    def __init__(self, style, fault):
        self.style, self.fault, self.jobs, self.refusals = style, fault, {}, 0
        if style.get("fixed"):
            self.jobs["j0"] = {"id": "j0", "state": "queued", "since": 0.0, "runs": 0}

    def shown(self, job):
        if job["state"] == "running" and time.monotonic() - job["since"] > self.style.get("takes", 0.3):
            job["state"] = "done"
        value = {name: one for name, one in job.items() if name != "since"}
        if job["state"] in {"done", "cancelled"}:
            value["finished_at"] = str(time.monotonic() if self.fault == "the end moves" else job["since"])
        return {"job": value} if self.style.get("wrapped") else value

    def answer(self, job, status=200):
        if status == 200 and self.style.get("silent"):
            return web.Response(status=204)
        return web.json_response(self.shown(job), status=status)

    async def every(self, _):
        return web.json_response([{"id": one["id"], "state": one["state"]} for one in self.jobs.values()])

    async def create(self, _):
        id_ = f"j{len(self.jobs)}"
        self.jobs[id_] = {"id": id_, "state": "queued", "since": 0.0}
        answer = self.answer(self.jobs[id_], self.style.get("created", 201))
        answer.headers["Location"] = f"/jobs/{id_}"
        return answer

    async def read(self, request):
        job = self.jobs.get(request.match_info["id"])
        return web.json_response(self.shown(job)) if job else error(404, "no such job")

    async def start(self, request):
        job = self.jobs.get(request.match_info["id"])
        if job is None:
            return error(404, "no such job")
        self.shown(job)
        allowed = {"queued", "cancelled"} if self.fault == "cancelled is started" else {"queued"}
        if job["state"] not in allowed:
            self.refusals += 1
            if self.fault == "a refused start counts":
                job["runs"] += 1
            if self.fault == "a refused start revives" and job["state"] == "cancelled":
                job.update(state="running", since=time.monotonic())
            return error(409, f"it is {job['state']}")
        if self.fault == "start is told and not done":
            return web.json_response({"id": job["id"], "state": "running"})
        job.update(state="running", since=time.monotonic())
        return self.answer(job)

    async def requeue(self, request):
        job = self.jobs.get(request.match_info["id"])
        if job is None:
            return error(404, "no such job")
        self.shown(job)
        states = {"a queued one is queued": {"queued", "cancelled"}, "none is queued again": {}}
        if job["state"] not in states.get(self.fault, {"cancelled"}):
            return error(409, f"it is {job['state']}")
        job["state"] = "queued"
        return self.answer(job)

    async def cancel(self, request):
        job = self.jobs.get(request.match_info["id"])
        if job is None:
            return error(404, "no such job")
        self.shown(job)
        if job["state"] == "cancelled" and self.style.get("again"):
            return self.answer(job)
        is_kept = not (self.fault == "done is cancelled" and job["state"] == "done")
        if job["state"] in {"done", "cancelled"} and is_kept:
            if self.fault == "a refused cancel acts":
                job["state"] = "cancelled" if job["state"] == "done" else "done"
            return error(409, f"it is {job['state']}")
        if self.fault == "cancel is told and not done" and job["state"] == "running":
            return web.json_response({"id": job["id"], "state": "cancelled"})
        if self.fault == "cancel after a refusal is not done" and self.refusals:
            return web.json_response({"id": job["id"], "state": "cancelled"})
        job["state"] = "cancelled"
        return self.answer(job)


def _jobs(style, fault):
    device = _Jobs(style, fault)
    job = {"type": "object", "properties": {"id": {"type": "string"}, "state": {"enum": _STATES}}}
    shown = {"type": "object", "properties": {"job": job}} if style.get("wrapped") else job
    job["properties"] |= {"runs": {"type": "integer"}, "finished_at": {"type": "string"}}
    status = str(style.get("created", 201))
    said = "In another state it is answered 409, and nothing changes."
    acting = {"200": answers(shown), "204": {"description": "done"}, "409": REFUSED, **_BAD}
    document = described(
        {
            "/jobs": {
                "get": {"responses": {"200": answers({"type": "array", "items": job})}},
                **({} if style.get("fixed") else {"post": {"responses": {status: answers(shown), **_BAD}}}),
            },
            "/jobs/{id}": reading(shown, parameters=[_ID]),
            "/jobs/{id}/start": {
                "parameters": [_ID],
                "post": {"summary": f"Start a queued job. {said}", "responses": acting},
            },
            "/jobs/{id}/cancel": {"parameters": [_ID], "post": {"responses": acting}},
        }
    )
    requeue = {"summary": "A cancelled job becomes queued. In every other state: 409.", "responses": acting}
    if style.get("again and again"):
        document["paths"]["/jobs/{id}/requeue"] = {"parameters": [_ID], "post": requeue}
    routes = {
        "/jobs": {"GET": device.every, **({} if style.get("fixed") else {"POST": device.create})},
        "/jobs/{id}": {"GET": device.read},
        "/jobs/{id}/start": {"POST": device.start},
        "/jobs/{id}/cancel": {"POST": device.cancel},
        "/jobs/{id}/requeue": {"POST": device.requeue},
    }
    return document, routes


class _Racks:
    """A device of racks, and of boxes in them."""

    def __init__(self, style, fault):
        self.style, self.fault, self.racks, self.boxes = style, fault, {}, {}

    def create(self, things, name, **members):
        id_ = f"{name[0]}{len(things)}"
        things[id_] = {"id": id_, **members}
        return web.json_response(things[id_], status=201, headers={"Location": f"/{name}/{id_}"})

    async def make_rack(self, _):
        return self.create(self.racks, "racks")

    async def make_box(self, request):
        try:
            body = await request.json()
        except ValueError:
            return error(400, "no JSON")
        rack = body.get("rack_id") if isinstance(body, dict) else None
        if not isinstance(rack, str) or self.racks.get(rack) is None:
            return error(422, "no such rack")
        return self.create(self.boxes, "boxes", rack_id=rack)

    def reader(self, things):
        async def read(request):
            found = things.get(request.match_info["id"])
            return web.json_response(found) if found else error(404, "not there")

        return read

    def dropper(self, things):
        async def drop(request):
            id_ = request.match_info["id"]
            if things.get(id_) is None:
                return error(404, "not there")
            inside = [one for one, box in self.boxes.items() if box and box["rack_id"] == id_]
            if inside and self.style == "with what is in it":
                self.boxes.update(dict.fromkeys(inside))
            elif inside and not self.fault and self.style != "says nothing":
                return error(409, "in use")
            things[id_] = None
            return web.Response(status=204)

        return drop


def _racks(style, fault):
    device = _Racks(style, fault)
    rack = {"type": "object", "properties": {"id": {"type": "string"}}}
    sent = {"type": "object", "required": ["rack_id"], "properties": {"rack_id": {"type": "string"}}}
    box = {**sent, "properties": {**sent["properties"], "id": {"type": "string"}}}
    said = {"summary": "Remove a rack; 409 while it is in use"} if style != "says nothing" else {}
    gone = {"204": {"description": "gone"}, "404": REFUSED, "409": REFUSED, **_BAD}
    posted = {"required": True, "content": {"application/json": {"schema": sent}}}
    document = described(
        {
            "/racks": {"post": {"responses": {"201": answers(rack)}}},
            "/racks/{id}": {**reading(rack), "parameters": [_ID], "delete": {**said, "responses": gone}},
            "/boxes": {"post": {"requestBody": posted, "responses": {"201": answers(box), **_BAD}}},
            "/boxes/{id}": {**reading(box), "parameters": [_ID], "delete": {"responses": gone}},
        }
    )
    routes = {
        "/racks": {"POST": device.make_rack},
        "/racks/{id}": {"GET": device.reader(device.racks), "DELETE": device.dropper(device.racks)},
        "/boxes": {"POST": device.make_box},
        "/boxes/{id}": {"GET": device.reader(device.boxes), "DELETE": device.dropper(device.boxes)},
    }
    return document, routes


#: Right devices: which, and its style.
_RIGHT = {
    "jobs that are taken": (_jobs, {"created": 202, "takes": 30}),
    "jobs that are done at once": (_jobs, {"takes": 0}),
    "jobs without a word": (_jobs, {"silent": True, "wrapped": True}),
    "jobs that are cancelled again": (_jobs, {"again": True, "wrapped": True}),
    "a job that is always there": (_jobs, {"fixed": True, "takes": 0.1}),
    "jobs that are queued again": (_jobs, {"again and again": True, "takes": 30}),
    "racks with what is in them": (_racks, "with what is in it"),
    "racks that may be missing": (_racks, "says nothing"),
}
#: Faults: of which device, in which style, and the requirement that is broken.
_BROKEN = {
    "cancel is told and not done": (_jobs, {"takes": 1}, _FOLLOWS),
    "cancel after a refusal is not done": (_jobs, {"created": 202, "takes": 30}, _FOLLOWS),
    "start is told and not done": (_jobs, {"takes": 30}, _FOLLOWS),
    "done is cancelled": (_jobs, {"takes": 0.02}, _FOLLOWS),
    "a refused cancel acts": (_jobs, {"takes": 0.2, "silent": True}, _FOLLOWS),
    "a refused start revives": (_jobs, {"takes": 30}, _FOLLOWS),
    "cancelled is started": (_jobs, {"fixed": True, "takes": 30}, _FOLLOWS),
    "a refused start counts": (_jobs, {"fixed": True, "takes": 30}, _KEEPS),
    "the end moves": (_jobs, {"takes": 0.02}, _FOLLOWS),
    "a queued one is queued": (_jobs, {"again and again": True, "takes": 30}, _FOLLOWS),
    "none is queued again": (_jobs, {"again and again": True, "takes": 30}, _FOLLOWS),
    "a rack in use is gone": (_racks, "", _GONE),
}


def _blamed(make, style, fault, tmp_path, *more):
    with small_device(*make(style, fault)) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--call=*", *more)
    return done.blamed, done.text


@pytest.mark.parametrize("name", _RIGHT)
def test_a_right_device_of_things_that_end_is_not_blamed(name, tmp_path):
    make, style = _RIGHT[name]
    blamed, text = _blamed(make, style, "", tmp_path)
    assert not blamed, text


@pytest.mark.side_by_side
@pytest.mark.parametrize("name", _BROKEN)
def test_a_fault_of_things_that_end_is_found(name, tmp_path):
    make, style, requirement = _BROKEN[name]
    blamed, text = _blamed(make, style, name, tmp_path, "--class", "description")
    assert requirement in blamed, text
