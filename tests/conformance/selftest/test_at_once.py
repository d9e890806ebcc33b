"""Judging several devices at once, and being interrupted."""

import subprocess
import sys
import time

import pytest

from proof.selftest import at_once
from proof.selftest.at_once import each_at_once, run_program

_WAITS = [sys.executable, "-c", "import time; time.sleep(60)"]


def test_an_interrupt_ends_a_program_that_runs(tmp_path):
    until = time.monotonic() + 30

    def judge(item):
        if item == "interrupt":
            while not at_once._PROGRAMS and time.monotonic() < until:  # noqa: SLF001 - nothing else shows that it runs
                time.sleep(0.01)
            raise KeyboardInterrupt
        run_program(_WAITS, str(tmp_path), 60.0)

    with pytest.raises(KeyboardInterrupt):
        each_at_once(judge, ["interrupt", "program"], 2, lambda _: None)
    assert time.monotonic() < until


def test_a_program_that_does_not_end_is_killed(tmp_path):
    with pytest.raises(subprocess.TimeoutExpired):
        run_program(_WAITS, str(tmp_path), 0.05)
