"""The first read after a pause is compared with those around it; a device that sleeps and wakes is right."""

import time

import pytest
from aiohttp import web
from small_device import answers, certified, described, error, object_of, reading, small_device

_NAMES = {"type": "array", "items": {"type": "string"}}
_STATE = object_of("sleeping", "job", sleeping={"type": "boolean"}, job={"type": "string", "nullable": True})


class Sleeper:
    """A device that sleeps after a second without requests.

    Args:
        fault: what its first response then is; empty: a right one.
    """

    def __init__(self, fault=""):
        self.fault, self.last = fault, time.monotonic()

    def routes(self):
        """Return the handlers of its paths."""
        reads = {"/shelves": self.shelves, "/state": self.state, "/clients": self.clients}
        return {path: {"GET": self.waking(read)} for path, read in reads.items()}

    def waking(self, read):
        async def wake(_):
            now = time.monotonic()
            sleeps, self.last = now - self.last > 1, now
            if self.fault == "busy" and sleeps:
                return error(503, "waking up", **{"Retry-After": "0"})
            if self.fault == "lost" and sleeps:
                return error(404, "no such path")
            return web.json_response(read(sleeps))

        return wake

    def shelves(self, sleeps):
        return [] if sleeps and self.fault == "empty" else ["left", "right"]

    def state(self, sleeps):
        return {"sleeping": sleeps, "job": None if sleeps and self.fault == "null" else "none"}

    def clients(self, sleeps):
        return {"clients": [] if sleeps else ["you"]}


@pytest.mark.side_by_side
@pytest.mark.parametrize(
    ("fault", "said"), [("", ""), ("empty", "0 as number of items"), ("lost", "404"), ("null", "/job")]
)
def test_the_first_response_after_a_pause_is_as_those_around_it(fault, said, tmp_path):
    device = Sleeper(fault)
    clients = reading(object_of(clients=_NAMES))
    paths = {
        "/shelves": {"get": {"responses": {"200": answers(_NAMES)}}},
        "/state": reading(_STATE),
        "/clients": clients,
    }
    with small_device(described(paths), device.routes()) as url:
        effort = "standard" if fault == "null" else "quick"  # another resource is read first there
        more = ("--select=robustness/recovers",)
        done = certified(f"{url}/openapi.json", tmp_path / "out", *more, effort=effort)
    judged = done.requirement("robustness/recovers")
    assert judged["verdict"] == ("fail" if said else "pass"), done.text
    assert said in done.text


def test_a_device_that_is_not_awake_at_once_is_not_blamed_for_its_pause(tmp_path):
    device = Sleeper("busy")
    with small_device(described({"/shelves": reading(_NAMES)}), device.routes()) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--select=robustness/recovers")
    assert "fail" not in done.blamed.values(), done.text
