"""What `roaas load` writes while it runs, and for programs."""

import json
import os
import pty
import re
import shlex
import subprocess

import pytest


@pytest.fixture
def robot(started):
    """Start a device that answers 2,000 requests a second; gives options that measure it."""
    port = started("bucket.py", "2000")[1]
    return f"http://127.0.0.1:{port}/openapi.json --operation 'GET /state' --rate 50 --warmup 0.1"


def test_json_is_all_that_a_program_reads(robot, load):
    run = load(robot, "--duration 1 --json --quiet")
    assert json.loads(run.out) == json.loads((run.folder / "latency.json").read_text())
    assert run.err == ""


def test_elsewhere_than_on_a_terminal_there_are_few_lines(robot, load):
    run = load(robot, "--duration 4")
    told = [line for line in run.err.splitlines() if re.search(r"[1-9]\d* requests answered", line)]
    assert len(told) == 1, run.err
    assert re.search(r"/s, 0 failed; p50 \S+, p90 \S+, p95 \S+, p99 \S+, max \S+ ms", told[0])


def test_a_terminal_has_one_line_that_is_renewed(robot, tmp_path, load_command):
    ours, theirs = pty.openpty()
    command = [*load_command, *shlex.split(robot), "--duration", "3", "--out", tmp_path / "out"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs, env=os.environ | {"TERM": "xterm"}) as run:
        os.close(theirs)
        shown = b""
        try:
            while part := os.read(ours, 4096):
                shown += part
        except OSError:  # Linux says so when nobody has the other end
            pass
        assert run.wait(60) in {0, 4}
    os.close(ours)
    live = [line for line in shown.decode().split("\n") if "requests answered" in line]
    assert len(live) == 1, shown
    assert live[0].count("\r") >= 3
