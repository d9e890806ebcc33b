"""How mutants notice that requests are concurrent."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Final

from proof.mutation.changes import Make, Where
from proof.mutation.messages import Change, Forward, Request, Response
from proof.mutation.wire import IncompleteMessageError

# How long a request waits for a concurrent one, s, as in a slow robot.
COMPANY_S: Final = 0.003


class Crowd:
    """The requests that are being answered at the moment."""

    def __init__(self) -> None:
        self._inside: list[threading.Event] = []
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def join(self) -> Iterator[Callable[[], bool]]:
        """Count the caller's request; yield a function that returns whether another one ran concurrently."""
        met = threading.Event()
        with self._lock:
            for other in self._inside:
                other.set()
                met.set()
            self._inside.append(met)
        try:
            yield met.is_set
        finally:
            with self._lock:
                self._inside.remove(met)


def when_crowded(where: Where, act: Callable[[Request, Forward], Response], nth: int = 1) -> Make:
    """Return a change that lets ``act`` answer every nth request which is concurrent with another of ``where``.

    Each request is held back a moment, so that others can come.
    """

    def make() -> Change:
        crowd, lock = Crowd(), threading.Lock()
        seen = 0

        def change(request: Request, forward: Forward) -> Response:
            nonlocal seen
            if not where(request):
                return forward(request)
            with crowd.join() as others:
                time.sleep(COMPANY_S)
                with lock:
                    seen += others()
                    chosen = others() and seen % nth == 0
                return act(request, forward) if chosen else forward(request)

        return change

    return make


def later(delay_s: float, act: Callable[..., object], *arguments: Any) -> None:
    """Call ``act`` in a thread after a delay, s; ignore errors, because the robot may have stopped by then."""

    def quietly() -> None:
        try:
            act(*arguments)
        except (OSError, IncompleteMessageError):
            return

    timer = threading.Timer(delay_s, quietly)
    timer.daemon = True
    timer.start()
