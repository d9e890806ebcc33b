"""A device of which no operation was called, or none succeeded, is inconclusive: it was not shown to keep anything."""

import pytest
from aiohttp import web
from camera import Camera
from small_device import REFUSED, certified, described, error, reading, small_device

_OPERATIONS = ("GetStatus", "GetPresets", "DescribePreset", "GetNodes", "GetSettings", "GetEvents", "GetSnapshot")
_POST = {"post": {"responses": {"204": {"description": "moved"}, "4XX": REFUSED}}}


async def _moved(_):
    return web.Response(status=204)


async def _unknown(_):
    return error(404, "no such valve")


async def _broken(_):
    return error(503, "no bus")


def _judged(folder, paths, routes, *more):
    with small_device(described(paths), routes) as url:
        return certified(f"{url}/openapi.json", folder, *more)


@pytest.mark.parametrize("more", [(), ("--class", "http")])
def test_nothing_called_is_inconclusive_and_says_what_is_needed(tmp_path, more):
    outcome = _judged(tmp_path, {"/move": _POST}, {"/move": {"POST": _moved}}, *more)
    assert (outcome.exit_code, outcome.blamed) == (4, {}), outcome.text
    assert outcome.result["verdict_line"] == (
        "inconclusive, because no operation could be called: POST /move: it may change something: --call allows it"
    )


def test_what_is_called_by_call_or_needs_no_operation_is_judged(tmp_path):
    for more in (("--call", "POST /move"), ("--class", "web-server")):
        outcome = _judged(tmp_path, {"/move": _POST}, {"/move": {"POST": _moved}}, *more)
        assert "no operation could be called" not in outcome.text
        assert outcome.result["verdict"] != "inconclusive", outcome.text


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (_unknown, "no operation succeeded; [values] in a statement names values"),
        (_broken, "no operation succeeded: each was answered 5xx"),
    ],
)
def test_an_operation_that_never_succeeds_shows_nothing(tmp_path, answer, why):
    valve = {"parameters": [{"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}]}
    paths = {"/valves/{id}": {**reading({"type": "object"}), **valve}}
    outcome = _judged(tmp_path, paths, {"/valves/{id}": {"GET": answer}}, "--class", "http")
    assert (outcome.exit_code, outcome.blamed) == (4, {}), outcome.text
    assert why in outcome.text


def test_a_soap_device_that_answers_faults_only_is_inconclusive(tmp_path):
    with small_device({}, Camera(dict.fromkeys(_OPERATIONS, "fault")).routes) as url:
        outcome = certified(f"{url}/a/camera.wsdl", tmp_path, "--never", "GetGain")
    assert outcome.exit_code == 4, outcome.text
    assert outcome.result["verdict_line"].startswith("inconclusive, because no operation succeeded")
