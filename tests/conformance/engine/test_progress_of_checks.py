"""The progress of a run: a bar on a terminal, lines elsewhere, nothing where nobody wants it."""

import io
import threading
from types import SimpleNamespace

import pytest

from conformance.engine.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def robot():
    run = SimpleNamespace(judge=SimpleNamespace(failure_counts=dict), contract=SimpleNamespace(ledger={}))
    return SimpleNamespace(run=run, connection=SimpleNamespace(sent=7))


def check(name):
    return SimpleNamespace(name=f"test_{name}", get_closest_marker=lambda _: None)


def written(out, *, bar=True):
    """What a run of two checks writes to a stream."""
    progress = Progress(robot(), out, bar=bar)
    checks = [check("first_one"), check("second_one")]
    progress.pytest_collection_finish(SimpleNamespace(items=checks))
    for one in checks:
        hook = progress.pytest_runtest_protocol(one)
        next(hook)
        with pytest.raises(StopIteration):
            hook.send(None)
    progress.end()
    return out.getvalue() if out else ""


@pytest.fixture(autouse=True)
def _terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "64")


def test_a_terminal_shows_a_bar_that_fits_into_a_line_and_gives_the_cursor_back():
    text = written(Terminal())
    drawn = text.replace("\x1b[?25l", "").replace("\x1b[?25h", "").split("\r")
    assert "2/2" in drawn[-1]
    assert "7 requests | first one" in text
    assert max(len(line.rstrip("\n")) for line in drawn) <= 64
    assert text.endswith("\x1b[?25h\n")
    assert "\x1b[3" not in text, "no colour"


@pytest.mark.parametrize("term", ["dumb", ""])
def test_a_terminal_that_cannot_move_its_cursor_gets_lines(monkeypatch, term):
    monkeypatch.setenv("TERM", term)
    assert "\x1b" not in written(Terminal())


@pytest.mark.parametrize(("out", "bar"), [(io.StringIO(), True), (Terminal(), False)])
def test_lines_tell_how_many_checks_are_done(out, bar):
    first, last = written(out, bar=bar).splitlines()
    assert "0/2 checks, 7 requests" in first
    assert "first one" in first
    assert last.endswith("2/2 checks, 7 requests | done")


class Waiting(io.StringIO):
    """A stream that says when a second line, or a bar with seconds, was written."""

    def __init__(self, *, is_terminal):
        super().__init__()
        self.isatty, self.renewed = (lambda: is_terminal), threading.Event()

    def write(self, text):
        if ("first one" in text and "first one" in self.getvalue()) or "), 0 s" in text:
            self.renewed.set()
        return super().write(text)


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_check_that_takes_long_is_seen_to_go_on(monkeypatch, is_terminal):
    for name in ("_OFTEN_S", "_WITHIN_S", "_RENEWED_S"):
        monkeypatch.setattr(f"conformance.engine.progress.{name}", 0.01)
    monkeypatch.setenv("COLUMNS", "120")
    out = Waiting(is_terminal=is_terminal)
    progress = Progress(robot(), out, bar=True)
    progress.pytest_collection_finish(SimpleNamespace(items=[check("first_one")]))
    hook = progress.pytest_runtest_protocol(check("first_one"))
    next(hook)
    assert out.renewed.wait(30), out.getvalue()
    progress.end()


def test_without_a_stream_nothing_is_written():
    assert written(None) == ""
