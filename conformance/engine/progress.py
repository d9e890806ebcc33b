"""Progress of a run, as a bar or as lines of text; and signals that end a run, which then never looks complete.

Python raises KeyboardInterrupt wherever the main thread happens to be. In a finalizer or a callback whose exceptions
are ignored, the exception is lost; the recorded flag is not. It is checked before each check and at the end.
"""

import os
import shutil
import signal
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, TextIO

import click
import pytest

from conformance.commandline.endings import ended_by, ending_signals
from conformance.contract.classes import Level
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.scenarios.stage import STAGES
from conformance.verdict.causes import by_cause
from conformance.verdict.finding import count_of
from conformance.verdict.run import Run

if TYPE_CHECKING:
    from click._termui_impl import ProgressBar

# For this time after KeyboardInterrupt, s, further signals are only recorded, because the checks are ending.
_LEAVES_S: Final = 2.0


class Interruption:
    """The signals of one run.

    Args:
        run: its ``interrupted`` and ``ended_by`` are set.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._raised_at: float | None = None
        self._is_closing = False

    def only_record(self) -> None:
        """Raise nothing from now on: the robot is stopped and the result is written, which takes a bounded time."""
        self._is_closing = True

    def handle(self, number: int, _frame: FrameType | None) -> None:
        """Record a signal, and raise KeyboardInterrupt."""
        self._run.interrupted = True
        self._run.signals += 1
        self._run.ended_by = self._run.ended_by or ended_by(number)
        now = time.monotonic()
        if self._is_closing or (self._raised_at is not None and now - self._raised_at < _LEAVES_S):
            return
        self._raised_at = now
        raise KeyboardInterrupt


@contextmanager
def note_signals(run: Run) -> Iterator[Interruption]:
    """Set ``run.interrupted`` on a signal and raise KeyboardInterrupt as usual.

    Ctrl-Z does not suspend a run that may move the robot: nothing would watch the robot then. Outside the main thread,
    where no signal arrives, this does nothing.
    """
    interruption = Interruption(run)
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    before = {number: signal.signal(number, interruption.handle) for number in ending_signals()}
    if (run.allow_motion or run.statement.calls.allow) and hasattr(signal, "SIGTSTP"):
        before[signal.SIGTSTP] = signal.signal(signal.SIGTSTP, lambda _number, _frame: None)
    try:
        yield interruption
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# A line at least so often, s: where a check ends, and within one.
_OFTEN_S, _WITHIN_S = 2.0, 10.0
# The bar is renewed so often within a check, s.
_RENEWED_S = 1.0
_BAR = 24  # columns of the bar
_BEFORE_TEXT = 42  # columns of the bar with brackets, counts and blanks
# Words for a requirement that is not met, by level; what a robot MAY do is no failure.
_WORDS = {Level.MUST: "fail", Level.SHOULD: "warn"}


def _has_bar(out: TextIO | None) -> bool:
    """Return whether a stream is a terminal that can move its cursor."""
    return out is not None and out.isatty() and os.environ.get("TERM") not in {None, "", "dumb"}


class Progress:
    """A pytest plugin that writes the progress of the checks to ``out``, or nothing if that is None.

    Args:
        robot: the connected robot.
        out: stream, or None.
        bar: whether to draw a bar if ``out`` is a terminal.
    """

    def __init__(self, robot: RobotUnderTest, out: TextIO | None, *, bar: bool = False) -> None:
        self._robot, self._out, self._drawn = robot, out, bar and _has_bar(out)
        self._started = self._told = time.monotonic()
        self._phase = self._found = ""
        self._failures = 0
        self._done = self._total = 0
        self._bar: ProgressBar[Any] | None = None
        self._text, self._began = "", self._started
        self._ends, self._writing = threading.Event(), threading.Lock()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Store the number of checks."""
        self._total = len(session.items)
        if self._drawn:
            self._bar = click.progressbar(
                length=self._total, file=self._out, show_eta=False, show_pos=True, width=_BAR, item_show_func=_fit
            )
        if self._out is not None:
            threading.Thread(target=self._renew, daemon=True).start()

    def _renew(self) -> None:
        """Show within a check that the run goes on, with the findings that were counted before it."""
        while not self._ends.wait(_RENEWED_S):
            with self._writing:
                now = time.monotonic()
                if self._bar is not None and self._text and now - self._began > _OFTEN_S:
                    self._draw(f"{self._requests()}{self._found} | {self._text}, {now - self._began:.0f} s")
                elif self._bar is None and self._text and now - self._told > _WITHIN_S:
                    self._told = now
                    self._write(self._text, f"{self._requests()}{self._found}")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Redraw the bar; or write a line when a stage begins, and when none was written for a while."""
        mark = item.get_closest_marker("phase")
        phase = mark.args[0] if mark else STAGES[0]
        text = item.name.partition("[")[0].removeprefix("test_").replace("_", " ")
        now = time.monotonic()
        with self._writing:
            self._text, self._began = text, now
            if self._bar is not None:
                self._draw(f"{self._so_far()} | {text}")
            elif phase != self._phase or now - self._told > _OFTEN_S:
                self._phase, self._told = phase, now
                self._write(text, self._so_far())
        result = yield
        with self._writing:
            self._done += 1
            if self._bar is not None:
                self._bar.update(1)
        return result

    def end(self) -> None:
        """Write the last line, or leave the bar's, also after an interruption."""
        with self._writing:
            self._ends.set()
        if self._bar is None:
            self._write("done", self._so_far())
        else:
            self._draw(f"{self._so_far()} | done")
            self._bar.render_finish()

    def _so_far(self) -> str:
        """Return the requests and the requirements that fail or warn, in the words and numbers of the summary."""
        run = self._robot.run
        failures = sum(run.judge.failure_counts().values())
        if failures != self._failures:
            # One cause counts as one finding, under the first requirement that reports it.
            self._failures = failures
            _, causes = by_cause(run.judge.evidence, run.contract.ledger, run.claims, run.scored_ids, run.beside)
            found = [cause.finding for cause in causes if run.selection.has(cause.finding.requirement)]
            # A requirement fails if one of its findings is beyond doubt.
            level_of = {finding.requirement: Level.SHOULD for finding in found}
            level_of |= {
                finding.requirement: run.contract.ledger[finding.requirement].level
                for finding in found
                if not finding.doubt
            }
            levels = Counter(
                Level.SHOULD if run.scored_ids is not None and id_ not in run.scored_ids else level
                for id_, level in level_of.items()
                if run.contract.ledger[id_].class_ not in run.beside
            )
            self._found = "".join(f", {levels[level]} {word}" for level, word in _WORDS.items() if levels[level])
        return f"{self._requests()}{self._found}"

    def _draw(self, text: str) -> None:
        """Draw the bar with a text; its own ``update`` draws after whole steps alone."""
        if self._bar is not None:
            self._bar.current_item = text
            self._bar.render_progress()

    def _requests(self) -> str:
        return count_of(self._robot.connection.sent, "request")

    def _write(self, text: str, so_far: str) -> None:
        if self._out is None:
            return
        self._out.write(
            f"[{time.monotonic() - self._started:5.1f} s] {self._done:3d}/{self._total} checks, {so_far} | {text}\n"
        )
        self._out.flush()


def _fit(text: str | None) -> str:
    """Return as much of a text as fits behind the bar: a line that wraps could not be drawn over."""
    return (text or "")[: max(0, shutil.get_terminal_size().columns - _BEFORE_TEXT)]
