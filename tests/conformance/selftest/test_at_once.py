"""Judging several devices at once, and being interrupted; what a mutant does later."""

import subprocess
import sys
import threading
import time

import pytest

from proof.mutation.wire import IncompleteMessageError
from proof.selftest import at_once
from proof.selftest.at_once import each_at_once, run_program
from proof.table1.mutants.crowd import later

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


def test_it_is_done_with_its_arguments():
    done, given = threading.Event(), []
    later(0.01, lambda *arguments: (given.extend(arguments), done.set()), 1, "b")
    assert done.wait(30)
    assert given == [1, "b"]


@pytest.mark.parametrize("error", [ConnectionRefusedError, IncompleteMessageError])
def test_a_run_that_is_over_is_nobodys_business(error, monkeypatch):
    told, raised = [], threading.Event()
    monkeypatch.setattr(threading, "excepthook", told.append)

    def act():
        raised.set()
        raise error

    before = set(threading.enumerate())
    later(0, act)
    assert raised.wait(30)
    for thread in set(threading.enumerate()) - before:
        thread.join(5)
    assert told == []
