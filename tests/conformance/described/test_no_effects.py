"""A GET, HEAD or OPTIONS that changes what no client writes is found; a device that records its requests is right."""

import asyncio
import time

import pytest
from aiohttp import web
from small_device import answers, certified, described, error, object_of, reading, small_device

_BOOL, _TEXT, _COUNT = {"type": "boolean"}, {"type": "string"}, {"type": "integer", "minimum": 0}
_STATUS = object_of("lamp", "pump", "door", lamp=_BOOL, pump=_TEXT, door=_TEXT, level={"type": "number"}, horn=_BOOL)
_RECORDS = object_of("requests", requests=_COUNT, lastPath=_TEXT, lastRequest=_TEXT, sleeping=_BOOL)
_BEDS = {"type": "array", "items": object_of("id", "name", "watered", id=_COUNT, name=_TEXT, watered=_COUNT)}
_ON = {"name": "on", "in": "query", "required": True, "schema": _BOOL}
_PATH = {"name": "bed", "in": "path", "required": True, "schema": {"type": "integer"}}
_DONE = {"204": {"description": "done"}, "4XX": answers(object_of("error", error=_TEXT))}


def _post(**members):
    return {"responses": _DONE, **members}


class House:
    """A greenhouse.

    Args:
        fault: what a safe request does; empty: nothing but what devices may do, such as counting requests.
    """

    def __init__(self, fault=""):
        self.fault, self.lamp, self.door, self.requests, self.watered = fault, False, "shut", 0, 0
        self.pumping = self.horn_until = float("inf")
        self.notices, self.alarms, self.paths = ["begun"], ["begun"], ["/"]

    def description(self):
        """Return its description."""
        beds = {"get": {"responses": {"200": answers(_BEDS)}}}
        bed = reading(_BEDS["items"], parameters=[_PATH])
        texts = {"type": "array", "items": _TEXT}
        drained = reading(texts, summary="Return the notices and remove them.")
        return described(
            {
                "/status": reading(_STATUS),
                "/records": reading(_RECORDS),
                "/beds": beds,
                "/beds/{bed}": bed,
                "/alarms": reading(texts),
                "/notices": drained,
                "/lamp": {"put": _post(parameters=[_ON])},
                "/pump": {"post": _post()},
                "/horn": {"post": _post()},
                "/water": {"post": _post()},
            }
        )

    def routes(self):
        """Return the handlers of its paths."""
        reads = {
            "/status": self.status, "/records": self.records, "/beds": self.beds, "/beds/{bed}": self.bed,
            "/alarms": self.alarm_list, "/notices": self.drain,
        }  # fmt: skip
        acts = {"/lamp": ("PUT", self.switch), "/pump": ("POST", self.start), "/horn": ("POST", self.blow)}
        acts["/water"] = ("POST", self.pour)
        found = {path: {"GET": self.noting(read), "HEAD": self.noting(read)} for path, read in reads.items()}
        return found | {path: {method: self.noting(act)} for path, (method, act) in acts.items()}

    def noting(self, handle):
        async def note_and_handle(request):
            self.requests += 1
            self.paths.append(request.path)
            if self.fault == "HEAD opens the door" and request.method == "HEAD":
                self.door = "open"
            return handle(request)

        return note_and_handle

    def status(self, _):
        now = time.monotonic()
        pump = "idle" if now < self.pumping else "running" if now < self.pumping + 0.7 else "done"
        seen = {"lamp": self.lamp, "pump": pump, "door": self.door, "level": now % 1, "horn": now < self.horn_until}
        if self.fault == "the status switches its lamp":
            self.lamp = not self.lamp
        return web.json_response(seen)

    def records(self, _):
        seen = {"requests": self.requests, "lastPath": self.paths[-2], "sleeping": False}
        return web.json_response(seen | {"lastRequest": time.strftime("%H:%M:%S")})

    def beds(self, _):
        if self.fault == "the list switches the lamp on":
            self.lamp = True
        return web.json_response(
            [{"id": number, "name": f"bed {number}", "watered": self.watered} for number in (1, 2)]
        )

    def bed(self, request):
        if request.match_info["bed"] not in {"1", "2"}:
            if self.fault == "a 404 shuts the door":
                self.door = "shut"
            return error(404, "no such bed")
        seen, self.watered = self.watered, 0 if self.fault == "a read resets the count" else self.watered
        return web.json_response({"id": int(request.match_info["bed"]), "name": "bed", "watered": seen})

    def alarm_list(self, _):
        seen, self.alarms = self.alarms, [] if self.fault == "a read empties the list" else self.alarms
        return web.json_response(seen)

    def drain(self, _):
        seen, self.notices = self.notices, []
        return web.json_response(seen)

    def switch(self, request):
        if request.query.get("on") not in {"true", "false"} or len(request.query) > 1:
            return error(422, "on is a boolean")
        self.lamp, self.door = request.query["on"] == "true", "ajar" if self.fault.endswith("the door") else "shut"
        return web.Response(status=204)

    def start(self, _):
        self.pumping = time.monotonic() + 0.2
        return web.Response(status=204)

    def blow(self, _):
        self.horn_until = time.monotonic() + 0.1
        return web.Response(status=204)

    def pour(self, _):
        self.watered += 1
        self.notices.append("poured")
        self.alarms = [*self.alarms[-9:], "poured"]
        return web.Response(status=204)


def _judgement(tmp_path, fault, *more):
    house = House(fault)
    with small_device(house.description(), house.routes()) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--call=*", *more)
    return done.requirement("description/safe"), done.text


@pytest.mark.parametrize("effort", ["quick", "standard"])
def test_what_a_right_device_does_beside_reading_is_no_effect(effort, tmp_path):
    house = House()
    with small_device(house.description(), house.routes()) as url:
        done = certified(
            f"{url}/openapi.json", tmp_path / "out", "--call=*", "--select=description/safe", effort=effort
        )
    assert done.requirement("description/safe")["verdict"] == "pass", done.text


@pytest.mark.side_by_side
@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("the status switches its lamp", "lamp in GET /status to stay the same while only GET /status is sent"),
        ("the list switches the lamp on", "lamp in GET /status to stay false after GET /beds"),
        ("a 404 shuts the door", 'door in GET /status to stay "ajar" after GET /beds/'),
        ("HEAD opens the door", 'door in GET /status to stay "ajar" after HEAD /'),
        ("a read resets the count", "watered in GET /beds/{bed} to stay 1"),
        ("a read empties the list", "number of items in GET /alarms to stay"),
    ],
)
def test_the_effect_of_a_safe_request_is_found(fault, said, tmp_path):
    judged, text = _judgement(tmp_path, fault, "--select=description/safe")
    assert judged["verdict"] == "fail", text
    assert said in text


def test_a_read_that_takes_long_is_not_repeated_again_and_again(tmp_path):
    house, reports = House(), []

    async def report(_):
        reports.append(time.monotonic())
        await asyncio.sleep(0.4)
        return web.json_response({"text": "all is well"})

    description, routes = house.description(), house.routes() | {"/report": {"GET": report}}
    description["paths"]["/report"] = reading(object_of("text", text=_TEXT))
    with small_device(description, routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--call=*", "--select=description/safe")
    assert done.requirement("description/safe")["verdict"] == "pass", done.text
    assert len(reports) < 30, len(reports)
