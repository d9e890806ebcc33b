"""Devices on FastAPI and on Express that keep their descriptions: nothing is found on them."""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from processes import free_port

from proof.cli.selftest import selftest

_DEVICES = Path(__file__).parents[1] / "described_devices"
_START_S = 60.0


# Express comes by npm, which not every machine with Node.js has.
@pytest.fixture(name="device", params=["rig.py", *(["feeder.js"] if shutil.which("npm") else [])])
def device_fixture(request, tmp_path):
    """Start a clean device; yield the URL of its description."""
    port, environment = free_port(), dict(os.environ)
    command = [sys.executable, str(_DEVICES / "rig.py"), "--port", str(port)]
    if request.param == "feeder.js":
        command = [shutil.which("node") or "node", str(_DEVICES / "feeder.js"), str(port)]
        environment["NODE_PATH"] = str(tmp_path / "node_modules")
        subprocess.run(["npm", "install", "--prefix", str(tmp_path), "express@5"], check=True, capture_output=True)
    with subprocess.Popen(command, env=environment) as process:
        try:
            _wait_for(port, process)
            yield f"http://127.0.0.1:{port}/openapi.json"
        finally:
            process.terminate()


def _wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + _START_S
    while time.monotonic() < until and process.poll() is None:
        with socket.socket() as sock:
            if sock.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the device does not start")


def test_nothing_is_found_on_a_clean_device_and_a_mutant_of_it_is_killed(device, tmp_path):
    """Judge the unchanged device with all its operations, and one mutant of each side."""
    words = ["--api", device, "--call", "*", "--generated", "2", "--out", str(tmp_path / "out")]
    words += ["--faults", "drop:GET*", "--faults", "takes-above:*"]
    done = CliRunner().invoke(selftest, words)
    found = json.loads((tmp_path / "out" / "selftest.json").read_text())
    assert found["false_alarms"] == {}, done.output
    assert [one["outcome"] for one in found["generated"]["mutants"]] == ["caught", "caught"], done.output
