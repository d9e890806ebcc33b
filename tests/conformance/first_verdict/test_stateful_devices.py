"""A right device that keeps state is judged alike by one run and the next, and a broken one is caught."""

from pathlib import Path
from typing import Any

import pytest
from small_device import Outcome, certified, small_device
from stateful_device import DESCRIPTION, StatefulDevice


def _twice(tmp_path: Path, *paths: str) -> list[Outcome]:
    """Certify one living device twice, as far as these paths go; all of it without any."""
    device = StatefulDevice()
    shown = paths or tuple(device.routes)
    description = {**DESCRIPTION, "paths": {path: DESCRIPTION["paths"][path] for path in shown}}
    with small_device(description, {path: device.routes[path] for path in shown}) as url:
        return [certified(f"{url}/openapi.json", tmp_path / str(turn), "--call", "*") for turn in range(2)]


def _said(outcome: Outcome) -> tuple[Any, ...]:
    return outcome.exit_code, outcome.result["verdict"], outcome.result["classes"], outcome.blamed


def test_a_right_device_that_keeps_state_gets_the_same_verdict_again(tmp_path: Path) -> None:
    first, second = _twice(tmp_path)
    assert first.exit_code == 0, first.text
    assert first.blamed == {}
    assert _said(second) == _said(first)
    assert "suite_errors" not in second.result


def test_what_the_state_does_not_allow_is_not_seen(tmp_path: Path) -> None:
    first, second = _twice(tmp_path, "/start")
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


@pytest.fixture(name="broken", scope="module")
def _broken(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    device = StatefulDevice(broken=True)
    with small_device(DESCRIPTION, device.routes) as url:
        return certified(f"{url}/openapi.json", tmp_path_factory.mktemp("broken"), "--call", "*")
