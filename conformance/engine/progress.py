"""Progress of a run, as lines of text."""

import time
from collections.abc import Iterator
from typing import TextIO

import pytest

from conformance.contract.classes import Level
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.scenarios.stage import STAGES

# A line at least this often, s.
_OFTEN_S = 2.0


class Progress:
    """A pytest plugin that writes progress lines to ``out``, or nothing if that is None."""

    def __init__(self, robot: RobotUnderTest, out: TextIO | None) -> None:
        self._robot, self._out = robot, out
        self._started = self._told = time.monotonic()
        self._phase = ""
        self._done = self._total = 0

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Store the number of checks."""
        self._total = len(session.items)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Write a line when a stage begins, and when none was written for a while."""
        mark = item.get_closest_marker("phase")
        phase = mark.args[0] if mark else STAGES[0]
        now = time.monotonic()
        if phase != self._phase or now - self._told > _OFTEN_S:
            self._phase, self._told = phase, now
            self.tell(f"{phase}: {item.name.removeprefix('test_').replace('_', ' ')}")
        result = yield
        self._done += 1
        return result

    def tell(self, text: str) -> None:
        """Write one line."""
        if self._out is None:
            return
        run = self._robot.run
        # What a robot may do and does not is no failing of its.
        findings = sum(run.contract.ledger[id_].level is not Level.MAY for id_ in run.judge.refuted())
        found = f", {findings} requirement{'s' if findings != 1 else ''} not met" if findings else ""
        self._out.write(
            f"[{time.monotonic() - self._started:5.1f} s] {self._done:3d}/{self._total} checks, "
            f"{self._robot.connection.sent} requests{found} | {text}\n"
        )
        self._out.flush()
