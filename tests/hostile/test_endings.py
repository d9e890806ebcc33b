"""However a command ends, the robot that it moved is at rest, and from the first request on there is a result."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from moving_device import DESCRIPTION, MAP, Mover
from small_device import small_device

_CERTIFY = (sys.executable, "-m", "roaas", "certify")
_OPTIONS = ("--allow-motion", "--effort", "quick", "--class", "motion", "--timeout", "5")
# A process that starts a command, writes its pid, and waits for its end.
_PARENT = "import subprocess, sys; p = subprocess.Popen(sys.argv[1:]); print(p.pid, flush=True); p.wait()"


def _send(*numbers: signal.Signals) -> Callable[[subprocess.Popen[str]], object]:
    def end(process: subprocess.Popen[str]) -> None:
        for number in numbers:
            process.send_signal(number)

    return end


@dataclass(frozen=True)
class Ending:
    """How a command is ended.

    Attributes:
        name: of the case.
        moment: of the device.
        end: ends the command.
        said: is in a note of the result.
        code: the exit code; None: any.
    """

    name: str
    moment: Callable[[Mover], bool]
    end: Callable[[subprocess.Popen[str]], object]
    said: str
    code: int | None = 130


def _drives(times: int) -> Callable[[Mover], bool]:
    return lambda device: device.commands >= times and device.velocity != 0


ENDINGS = (
    Ending("Ctrl-C at the first request", lambda device: device.received >= 1, _send(signal.SIGINT), "SIGINT"),
    Ending("a closed terminal while it drives", _drives(1), _send(signal.SIGHUP), "SIGHUP"),
    Ending("a CI job that is cancelled", _drives(2), _send(signal.SIGTERM), "SIGTERM"),
    Ending("Ctrl-\\", _drives(2), _send(signal.SIGQUIT), "SIGQUIT"),
    Ending("a batch system's warning", _drives(1), _send(signal.SIGUSR1), "SIGUSR1"),
    Ending("an impatient user", _drives(1), _send(*[signal.SIGINT] * 20), "SIGINT"),
    Ending("all at once", _drives(2), _send(signal.SIGHUP, signal.SIGTERM, signal.SIGINT), "interrupted by SIG"),
)


def _statement(folder: Path, url: str) -> Path:
    path = folder / "device.toml"
    path.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}', encoding="utf-8")
    return path


def _result(out: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("ending", ENDINGS, ids=lambda ending: ending.name)
def test_a_run_that_is_ended_leaves_the_device_at_rest_and_a_result(ending, tmp_path):
    device, out = Mover(), tmp_path / "out"
    with small_device(DESCRIPTION, device.routes) as url:
        command = (*_CERTIFY, _statement(tmp_path, url), *_OPTIONS, "--out", out)
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
            assert device.await_that(ending.moment, process), process.communicate()
            ending.end(process)
            said, _ = process.communicate(timeout=120)
        assert device.velocity == 0, said
    assert "Traceback" not in said
    assert process.returncode == ending.code, said
    result = _result(out)
    assert result["interrupted"] is True
    assert ending.said in " ".join(result["notes"])


def test_a_run_ends_with_the_process_that_started_it(tmp_path):
    device, out = Mover(), tmp_path / "out"
    with small_device(DESCRIPTION, device.routes) as url:
        command = (sys.executable, "-c", _PARENT, *_CERTIFY, _statement(tmp_path, url), *_OPTIONS, "--out", out)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, stderr=subprocess.DEVNULL) as parent:
            assert device.await_that(_drives(1), parent)
            parent.kill()
            parent.communicate(timeout=120)  # the run's stdout is the parent's: it is closed at its end
        assert device.velocity == 0
    assert "interrupted by the end of its parent process" in " ".join(_result(out)["notes"])
