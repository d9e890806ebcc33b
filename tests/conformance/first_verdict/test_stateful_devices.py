"""A right device that keeps state is judged alike by one run and the next, and a broken one is caught."""

import re
from pathlib import Path
from typing import Any

import pytest
from aiohttp import web
from small_device import Outcome, certified, small_device
from stateful_device import DESCRIPTION, StatefulDevice


def _twice(device: StatefulDevice, tmp_path: Path, *paths: str) -> list[Outcome]:
    """Certify one living device twice, as far as these paths go; all of it without any."""
    shown = paths or tuple(device.routes)
    description = {**DESCRIPTION, "paths": {path: DESCRIPTION["paths"][path] for path in shown}}
    with small_device(description, {path: device.routes[path] for path in shown}) as url:
        return [certified(f"{url}/openapi.json", tmp_path / str(turn), "--call", "*") for turn in range(2)]


def _said(outcome: Outcome) -> tuple[Any, ...]:
    return outcome.exit_code, outcome.result["verdict"], outcome.result["classes"], outcome.blamed


def test_a_right_device_that_keeps_state_gets_the_same_verdict_again(tmp_path: Path) -> None:
    device = StatefulDevice()
    first, second = _twice(device, tmp_path)
    assert first.exit_code == 0, first.text
    assert first.blamed == {}
    assert _said(second) == _said(first)
    assert "suite_errors" not in second.result
    left = first.result["api"]["left_behind"]["lines"]
    assert left[0].startswith("created and not deleted: 5 by POST /queue (ids … 3, 4, 5), ")
    assert left[1:] == [
        "deleted: 3 by DELETE /logs/{id} (ids 3, 1, 2)",
        "called last: POST /lease with 201, POST /return-home with 200, POST /stop with 200 and 1 more",
    ]
    assert device.speed == 1, "what PUT changed is written back"
    created = [one for outcome in (first, second) for one in outcome.result["api"]["left_behind"]["created"]]
    assert {id_ for one in created if one["operation"] == "POST /jobs" for id_ in one["ids"]} == set(
        map(str, device.jobs)
    )
    page, markdown = ((tmp_path / "0" / f"certificate.{kind}").read_text(encoding="utf-8") for kind in ("html", "md"))
    for line in left:
        assert f"  {line}\n" in first.text
        assert line[1:] in page
        assert line[1:] in markdown
    # What stays without its success is named with what it would need, on the terminal and on the pages.
    assert re.search(r"  POST /start: \d+ times 409; needs another state of the device\n", second.text)
    assert re.search(r"  POST /lease: \d+ times 423; needs a lock or lease that another client may hold\n", second.text)
    # What needs a condition got it from the resource.
    assert "needs a condition" not in second.text
    markdown = (tmp_path / "1" / "certificate.md").read_text(encoding="utf-8")
    assert "`GET /logs/{id}` needs values that the device knows: id" in markdown


def test_what_the_state_does_not_allow_is_not_seen(tmp_path: Path) -> None:
    first, second = _twice(StatefulDevice(), tmp_path, "/start")
    assert (first.exit_code, second.exit_code) == (0, 0), second.text
    said = second.requirement("description/optional")
    assert said["verdict"] == "skip"
    assert said["reason"] == "not seen: POST /start was answered only 409: its state did not allow it"
    assert "not seen: POST /start" in second.requirement("description/body-schema")["reason"]
    assert "not seen" not in first.requirement("description/body-schema")["reason"]


@pytest.mark.parametrize("operation", ["POST /start", "POST /stop", "POST /return-home", "POST /lease", "POST /jobs"])
def test_a_wrong_answer_of_the_first_success_is_found(operation: str, broken: Outcome) -> None:
    failures = broken.requirement("description/body-schema")["failures"]
    assert operation in {one["operation"] for failure in failures for one in failure["operations"]}


def test_a_fault_that_only_one_state_shows_is_not_said_to_come_back(tmp_path: Path) -> None:
    device = StatefulDevice()
    modes = device.routes["/mode"]["GET"]

    async def wrong_while_idle(request: web.Request) -> web.StreamResponse:
        return web.json_response({"mode": 5}) if device.mode == "idle" else await modes(request)

    routes = {**device.routes, "/mode": {"GET": wrong_while_idle}}
    with small_device(DESCRIPTION, routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path, "--call", "*", "--select", "description/body-schema")
    (failure,) = done.requirement("description/body-schema")["failures"]
    assert "In 5 repetitions without the requests before it, the request failed 0 times" in failure["message"]
    assert "depends on the device's state" in failure["message"]


@pytest.fixture(name="broken", scope="module")
def _broken(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    device = StatefulDevice(broken=True)
    with small_device(DESCRIPTION, device.routes) as url:
        more = ("--call", "*", "--select", "description/body-schema")
        return certified(f"{url}/openapi.json", tmp_path_factory.mktemp("broken"), *more)


def test_a_thing_that_a_run_may_create_is_offered_beside_values(tmp_path: Path) -> None:
    async def nothing(request: web.Request) -> web.Response:
        return web.json_response({"detail": "none"}, status=404) if request.match_info else web.json_response([])

    routes = {"/jobs": {**StatefulDevice().routes["/jobs"], "GET": nothing}, "/jobs/{id}": {"GET": nothing}}
    item = {"get": DESCRIPTION["paths"]["/jobs/{id}"]["get"]}
    paths = {"/jobs": DESCRIPTION["paths"]["/jobs"], "/jobs/{id}": item}
    with small_device({**DESCRIPTION, "paths": paths}, routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out")
    assert "  or let the run create them: --call 'POST /jobs'\n" in done.text
