"""`make demo` ends in order on Ctrl-C: the commands write what they have, and the robot is gone."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

DEMO = Path(__file__).parents[2] / "demo.py"


@pytest.mark.parametrize("again", [False, True], ids=["once", "and again"])
@pytest.mark.parametrize(("number", "to_all"), [(signal.SIGINT, True), (signal.SIGTERM, False)], ids=["Ctrl-C", "TERM"])
def test_an_interrupted_demo_says_what_there_is_and_leaves_no_robot(tmp_path, number, to_all, again):
    command = [sys.executable, DEMO, "--out", tmp_path / "out"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    ) as demo:
        said = ""
        while "== 2/3" not in said:
            said += demo.stdout.readline()
        while not (tmp_path / "out/result.json").exists():
            assert demo.poll() is None, said
            time.sleep(0.05)
        started = psutil.Process(demo.pid).children(recursive=True)
        for _ in range(1 + again):
            os.killpg(demo.pid, number) if to_all else demo.send_signal(number)
        said += demo.communicate(timeout=120)[0]
    assert (demo.returncode, "Traceback" in said) == (130, False), said
    assert re.search(r"== interrupted after \d+ s; until then:\nconformance: inconclusive, 0 of", said), said
    assert json.loads((tmp_path / "out/result.json").read_text(encoding="utf-8"))["interrupted"] is True
    assert not psutil.wait_procs(started, timeout=60)[1]
