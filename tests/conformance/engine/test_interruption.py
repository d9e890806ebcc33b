"""A run that was broken off never looks complete, wherever the exception went."""

import gc
import os
import signal
import sys

import pytest

from conformance.engine.certification import certify
from conformance.engine.progress import note_signals
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.verdict.run import Run


class _Finalized:
    def __init__(self, number):
        self._number = number

    def __del__(self):
        os.kill(os.getpid(), self._number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_that_is_swallowed_is_remembered(number, monkeypatch):
    ignored = []
    monkeypatch.setattr(sys, "unraisablehook", lambda args: ignored.append(args.exc_type))
    run = Run()
    before = signal.getsignal(number)
    with note_signals(run):
        dying = _Finalized(number)
        del dying
        gc.collect()
    assert (ignored, run.interrupted) == ([KeyboardInterrupt], True)
    assert signal.getsignal(number) is before


def test_a_run_with_a_swallowed_interruption_ends_as_interrupted(tmp_path, monkeypatch):
    robot = RobotUnderTest(Run())

    def connect(_progress) -> None:
        robot.run.interrupted = True

    monkeypatch.setattr(robot, "connect", connect)
    ended = certify(robot, tmp_path, progress=None)
    assert (ended.exit_code, ended.document["interrupted"]) == (130, True)
