"""Runs of a kiln that start when it is lit, one alone: operations that its state forbids are reached and judged."""

import itertools
import time

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, described, error, small_device

_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_RUN = {
    "type": "object",
    "required": ["id", "state", "heat"],
    "properties": {
        "id": {"type": "string"},
        "state": {"enum": ["queued", "running", "paused", "aborted", "done"]},
        "heat": {"type": "integer", "description": "In ms of burning. It never falls."},
    },
}
_SAID = {
    "start": "From `queued` to `running`. 409 if the burner is out, and while another run is `running`.",
    "pause": "From `running` to `paused`.",
    "resume": "From `paused` to `running`. 409 while another run is `running`.",
    "abort": "Ends a run that is not over.",
}
_STEPS = {"start": ("queued", "running"), "pause": ("running", "paused"), "resume": ("paused", "running")}


class _Kiln:
    def __init__(self, fault):
        self.fault, self.lit, self.runs, self.numbers = fault, True, {}, itertools.count(1)

    def shown(self, id_):
        run = self.runs[id_]
        now = time.monotonic() - run["since"] if run["state"] == "running" else 0
        return {"id": id_, "state": run["state"], "heat": int(1000 * (run["burnt"] + now))}

    def lights(self, wanted):
        async def act(_):
            if self.lit is wanted:
                return error(409, "it is so")
            self.lit = wanted
            return web.json_response({"lit": wanted})

        return act

    async def every(self, _):
        return web.json_response([self.shown(one) for one in self.runs])

    async def create(self, _):
        id_ = f"r{next(self.numbers)}"
        self.runs[id_] = {"state": "queued", "since": 0.0, "burnt": 0.0}
        return web.json_response(self.shown(id_), status=201, headers={"Location": f"/runs/{id_}"})

    def of_run(self, answer):
        async def act(request):
            id_ = request.match_info["id"]
            is_kept = self.fault == "logs outlive their run" and request.path.endswith("/logs")
            return answer(id_) if id_ in self.runs or is_kept else error(404, "no such run")

        return act

    def delete(self, id_):
        if self.runs[id_]["state"] in {"running", "paused"}:
            return error(409, "it goes on")
        del self.runs[id_]
        return web.Response(status=204)

    def step(self, name):
        def act(id_):
            run, begun = self.runs[id_], time.monotonic()
            old, new = _STEPS.get(name, (run["state"], "aborted"))
            others = [key for key, one in self.runs.items() if key != id_ and one["state"] == "running"]
            is_alone = not others or self.fault == "two run at once"
            if run["state"] != old or old == "aborted":
                return error(409, f"it is {run['state']}")
            if new == "running" and not (is_alone and self.lit):
                return error(409, "not now")
            run["burnt"] += begun - run["since"] if old == "running" else 0
            if self.fault == "heat begins anew" and name == "resume":
                run["burnt"] = 0.0
            run.update(state=new, since=begun)
            value = self.shown(id_)
            if self.fault == "heat is a text" and name == "resume":
                value["heat"] = "hot"
            return web.json_response(value)

        return act


def _kiln(fault=""):
    kiln = _Kiln(fault)
    run, lit = {"200": answers(_RUN)}, {"200": answers({"type": "object"}), "409": REFUSED}
    absent, bad = {"404": REFUSED}, {"4XX": REFUSED}
    paths = {
        "/burner/light": {"post": {"summary": "Light the burner.", "responses": lit}},
        "/burner/out": {"post": {"summary": "Put the burner out.", "responses": lit}},
        "/runs": {
            "get": {"responses": {"200": answers({"type": "array", "items": _RUN}), **bad}},
            "post": {"responses": {"201": answers(_RUN), **bad}},
        },
        "/runs/{id}": {
            "parameters": [_ID],
            "get": {"responses": {**run, **absent}},
            "delete": {
                "description": "Its logs go with it; what was burnt stays. 409 while it goes on.",
                "responses": {"204": {"description": "gone"}, "409": REFUSED, **absent},
            },
        },
        "/runs/{id}/logs": {
            "parameters": [_ID],
            "get": {"responses": {"200": answers({"type": "array", "items": {"type": "string"}}), **absent}},
        },
    }
    for name, text in _SAID.items():
        act = {"description": text, "responses": {**run, **absent, "409": REFUSED}}
        paths[f"/runs/{{id}}/{name}"] = {"parameters": [_ID], "post": act}
    routes = {
        "/burner/light": {"POST": kiln.lights(True)},
        "/burner/out": {"POST": kiln.lights(False)},
        "/runs": {"GET": kiln.every, "POST": kiln.create},
        "/runs/{id}": {
            "GET": kiln.of_run(lambda id_: web.json_response(kiln.shown(id_))),
            "DELETE": kiln.of_run(kiln.delete),
        },
        "/runs/{id}/logs": {"GET": kiln.of_run(lambda _: web.json_response(["lit"]))},
        **{f"/runs/{{id}}/{name}": {"POST": kiln.of_run(kiln.step(name))} for name in _SAID},
    }
    return described(paths, "3.1.0"), routes


def _certified(fault, tmp_path, *more):
    with small_device(*_kiln(fault)) as url:
        return certified(f"{url}/openapi.json", tmp_path / "out", "--call=*", *more)


def test_a_right_kiln_is_reached_and_not_blamed(tmp_path):
    done = _certified("", tmp_path)
    assert done.blamed == {}, done.text
    assert "never answered 2xx" not in done.text


@pytest.mark.side_by_side
@pytest.mark.parametrize(
    ("fault", "requirement"),
    [
        ("two run at once", "description/states"),
        ("heat begins anew", "description/states"),
        ("heat is a text", "description/body-schema"),
        ("logs outlive their run", "description/deleted-is-gone"),
    ],
)
def test_what_the_state_forbade_is_judged(fault, requirement, tmp_path):
    done = _certified(fault, tmp_path, "--class", "description")
    assert done.blamed.keys() == {requirement}, done.text
