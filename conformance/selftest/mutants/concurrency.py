"""Robots that are right as long as one client asks one thing at a time."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Final

from conformance.selftest.messages import Change, Forward, Request, Response
from conformance.selftest.mutants.changes import Make, Where, rest
from conformance.selftest.mutants.mutant import of_class

# How long an answer waits for another one to be mixed up with, s.
_MEETS_S: Final = 0.05


class Crowd:
    """Knows which requests are being answered at one moment."""

    def __init__(self) -> None:
        self._inside = 0
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def joined(self) -> Iterator[Callable[[], bool]]:
        """Be one of them; what comes tells whether there are others."""
        with self._lock:
            self._inside += 1
        try:
            yield lambda: self._inside > 1
        finally:
            with self._lock:
                self._inside -= 1


class _Mixed:
    """Two answers that are made at one moment are mixed up, each nth time.

    Args:
        where: which requests' answers.
        mix: makes of the first and the second answer what the first client gets, and then the second one.
        nth: how often.
    """

    def __init__(self, where: Where, mix: Callable[[Response, Response], tuple[Response, Response]], nth: int) -> None:
        self._where, self._mix, self._nth = where, mix, nth
        self._crowd = Crowd()
        self._lock = threading.Lock()
        self._first: list[Response] = []
        self._met = threading.Event()
        self._seen = 0

    def __call__(self, request: Request, forward: Forward) -> Response:
        """See messages.Change."""
        if not self._where(request):
            return forward(request)
        with self._crowd.joined() as others:
            response = forward(request)
            return self._mixed_up(response) if others() else response

    def _mixed_up(self, response: Response) -> Response:
        with self._lock:
            self._seen += 1
            if self._first:
                return self._meet(response)
            if self._seen % self._nth:
                return response
            mine, met = self._first, self._met = [response], threading.Event()
        met.wait(_MEETS_S)
        with self._lock:
            if len(mine) == 1:
                self._first = []
            return mine[-1]

    def _meet(self, response: Response) -> Response:
        """Give the one who waits what becomes of its answer."""
        first, second = self._mix(self._first[0].copy(), response.copy())
        self._first.append(first)
        self._first = []
        self._met.set()
        return second


def _mixed(mix: Callable[[Response, Response], tuple[Response, Response]], nth: int = 1) -> Make:
    def make() -> Change:
        return _Mixed(rest("GET"), mix, nth)

    return make


def _exchanged(one: Response, two: Response) -> tuple[Response, Response]:
    return two, one


def _spliced(one: Response, two: Response) -> tuple[Response, Response]:
    """The second client gets its own beginning and the other one's end."""
    half = len(two.body) // 2
    two.body = two.body[:half] + one.body[half:]
    return one, two


def _repeated(one: Response, two: Response) -> tuple[Response, Response]:
    """Both get the first one's body."""
    two.body = one.body
    return one, two


_mutant = of_class("http", "rest")

MUTANTS = (
    _mutant(
        "clients-crossed",
        "Two clients that ask at one moment get each other's answers.",
        "concurrent-answers",
        _mixed(_exchanged),
    ),
    _mutant(
        "clients-crossed-seldom",
        "One time in fifty, two clients that ask at one moment get each other's answers.",
        "concurrent-answers",
        _mixed(_exchanged, 50),
    ),
    _mutant(
        "clients-spliced",
        "An answer ends as another one does that is made at the same moment.",
        "concurrent-answers",
        _mixed(_spliced),
    ),
    _mutant(
        "clients-one-buffer",
        "Answers that are made at one moment have one body.",
        "concurrent-answers",
        _mixed(_repeated, 10),
    ),
    _mutant(
        "http-pipelining-backwards",
        "Of two requests that were sent at once, the second is answered first.",
        "pipelining",
        lambda: lambda request, forward: forward(request),
        backwards=True,
    ),
)
