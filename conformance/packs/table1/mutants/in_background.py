"""What a mutant does by itself, after the response: in a thread, and for as long as the run lasts."""

import threading
from collections.abc import Callable
from typing import Any

from conformance.mutation.wire import IncompleteMessageError


def later(delay_s: float, act: Callable[..., object], *arguments: Any) -> None:
    """Do something after a delay, s; that the robot or the run is gone by then is nobody's business."""

    def quietly() -> None:
        try:
            act(*arguments)
        except (OSError, IncompleteMessageError):
            return

    timer = threading.Timer(delay_s, quietly)
    timer.daemon = True
    timer.start()
