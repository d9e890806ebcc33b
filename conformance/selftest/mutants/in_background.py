"""What a mutant does by itself, after the response: in a thread, and for as long as the run lasts."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from conformance.selftest.wire import IncompleteMessageError

if TYPE_CHECKING:
    from collections.abc import Callable


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
