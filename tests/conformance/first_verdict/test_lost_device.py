"""A device that crashes, hangs or stops listening fails, with the request that did it; a healthy or slow one passes."""

import asyncio
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from aiohttp import web
from processes import free_port
from small_device import Outcome, certified, described, reading, small_device

_ARM = Path(__file__).with_name("arm_server.py")


@contextmanager
def arm(how: str, folder: Path) -> Iterator[tuple[str, str]]:
    """Serve an arm; yields its base URL and the command that restarts it."""
    port = free_port()
    pid_file = folder / "pid"
    command = ["env", f"PYTHONPATH={_ARM.parents[2]}", sys.executable, str(_ARM), str(port), how, str(pid_file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            yield f"http://127.0.0.1:{port}", shlex.join(command)
        finally:
            # The device's process by now; the first one may have ended.
            with suppress(ProcessLookupError):
                os.kill(int(pid_file.read_text()), signal.SIGKILL)
            process.kill()


def judged(how: str, folder: Path, *more: object, restart: bool = False) -> Outcome:
    with arm(how, folder) as (url, command):
        more = (*more, "--restart-command", command) if restart else (*more, "--wait", "1")
        return certified(f"{url}/openapi.json", folder / "out", "--timeout", "2", *more)


def only_failure(outcome: Outcome, requirement: str) -> dict[str, Any]:
    (failure,) = outcome.requirement(requirement)["failures"]
    return failure


def test_a_healthy_arm_is_not_blamed(tmp_path):
    outcome = judged("well", tmp_path, "--class", "description", "--class", "robustness")
    assert (outcome.exit_code, outcome.blamed) == (0, {})


@pytest.mark.parametrize(("how", "requirement"), [("exit", "no-crash"), ("hang", "no-hang"), ("deaf", "no-hang")])
def test_a_device_that_stays_lost_fails_with_the_request_and_those_before_it(tmp_path, how, requirement):
    outcome = judged(how, tmp_path, "--class", "description", "--class", "robustness")
    failure = only_failure(outcome, f"robustness/{requirement}")
    assert outcome.exit_code == 1
    assert "/pose?z=" in failure["request"]["url"]
    assert "did not come back" in failure["message"]
    assert "The requests before it, newest first: `GET /" in failure["message"]
    assert outcome.result["verdict"] == "not-conformant"
    assert "error" not in {one["verdict"] for one in outcome.result["requirements"]}


def test_a_device_that_hangs_is_restarted_once_and_judged_to_the_end(tmp_path):
    outcome = judged("hang", tmp_path, restart=True)
    failure = only_failure(outcome, "robustness/no-hang")
    assert failure["request"]["url"].endswith(("z=1e%2B308", "z=-1e%2B308"))
    assert "sent alone after the device had come back, did it again" in failure["message"]
    # What was found besides is kept, and what comes after it is judged.
    assert outcome.requirement("description/body-schema")["verdict"] == "fail"
    assert outcome.requirement("description/allow")["verdict"] == "pass"


def test_a_crash_that_needs_two_requests_is_shown_by_the_two(tmp_path):
    outcome = judged("sequence", tmp_path, "--class", "robustness", restart=True)
    failure = only_failure(outcome, "robustness/no-crash")
    assert "did it again when these requests were repeated" in failure["message"]
    first, second = failure["sequence"]
    assert "/joints?index=-" in first["url"]
    assert "/pose" in second["url"]


def test_a_loss_counts_whatever_class_is_judged(tmp_path):
    outcome = judged("exit", tmp_path, "--class", "description", restart=True)
    assert outcome.exit_code == 1
    assert only_failure(outcome, "robustness/no-crash")["request"]["url"].endswith("1e%2B308")


def test_a_device_that_answers_500_ever_after_fails_and_is_not_called_lost(tmp_path):
    outcome = judged("poison", tmp_path, "--class", "robustness")
    assert outcome.exit_code == 1
    assert outcome.requirement("robustness/no-server-error")["verdict"] == "fail"
    assert outcome.requirement("robustness/no-crash")["verdict"] == "pass"


def test_a_device_that_dies_of_the_first_request_is_no_device_that_was_not_reached(tmp_path):
    outcome = judged("first", tmp_path)
    assert outcome.exit_code == 1
    assert only_failure(outcome, "robustness/no-crash")["request"]["url"].endswith("/joints")


_SCHEMA = {"type": "object", "required": ["level"], "properties": {"level": {"type": "integer"}}}
_PATHS = [f"/tank{number}" for number in range(8)]


def _device(hanging, takes_s=0.0):
    async def handle(request: web.Request) -> web.Response:
        await asyncio.sleep(3600 if request.path in hanging else takes_s)
        return web.json_response({"level": "full" if request.path == _PATHS[-1] and hanging else 1})

    return small_device(described(dict.fromkeys(_PATHS, reading(_SCHEMA))), {path: {"GET": handle} for path in _PATHS})


@pytest.mark.parametrize("hanging", [_PATHS[:2], _PATHS[1:6]])
def test_what_hangs_is_named_and_the_others_are_judged(hanging, tmp_path):
    began = time.monotonic()
    with _device(hanging) as url:
        done = certified(f"{url}/openapi.json", tmp_path, "--timeout", "2")
    assert time.monotonic() - began < 120
    named = {one["operation"] for one in done.requirement("robustness/no-hang")["failures"][0]["operations"]}
    assert named == {f"GET {path}" for path in hanging}
    assert done.requirement("description/body-schema")["verdict"] == "fail"
    assert set(done.blamed) == {"robustness/no-hang", "description/body-schema"}, done.text
