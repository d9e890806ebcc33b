"""What a mutant does after its response, in a daemon thread."""

import threading
from collections.abc import Callable
from typing import Any

from conformance.mutation.wire import IncompleteMessageError


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
