"""What a run says on standard error while it goes on: one renewed line on a terminal, few lines elsewhere."""

import os
import shutil
import sys
import time

from loadtests.statistics.recorder import Recorder

_OFTEN_S, _SELDOM_S = 1.0, 10.0  # from one line to the next: on a terminal, and elsewhere
_QUANTILES = (("p50", 0.5), ("p90", 0.9), ("p95", 0.95), ("p99", 0.99))


class Progress:
    """Says what happens.

    Args:
        mode: `auto` renews one line on a terminal and writes few lines elsewhere; `lines` writes one a second; `none`
            writes nothing.
    """

    def __init__(self, mode: str) -> None:
        self._silent, self._every_s = mode == "none", _SELDOM_S if mode == "auto" else _OFTEN_S
        self._renews = mode == "auto" and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        self._open = False
        self._due = 0.0
        self._before = (0.0, 0)  # when the last line was written, and how many requests were answered by then

    def say(self, message: str) -> None:
        """Write a line."""
        if not self._silent:
            self.end()
            sys.stderr.write(message + "\n")
            sys.stderr.flush()

    def look(self, recorder: Recorder, elapsed_s: float, length_s: float) -> None:
        """Say how far the run is, and its figures so far, if the next line is due."""
        now = time.monotonic()
        if self._silent or now < self._due:
            return
        line = self._figures(recorder, elapsed_s, length_s)
        answered = recorder.live.total
        self._due = now + (_OFTEN_S if self._renews or not answered else self._every_s)
        self._before = elapsed_s, answered
        if self._renews:
            width = shutil.get_terminal_size().columns
            sys.stderr.write(f"\r{line[: width - 1]}\x1b[K")
            self._open = True
        else:
            sys.stderr.write(line + "\n")
        sys.stderr.flush()

    def _figures(self, recorder: Recorder, elapsed_s: float, length_s: float) -> str:
        live, (before_s, before) = recorder.live, self._before
        failed = sum(failure.count for failure in recorder.failures.values())
        rate = (live.total - before) / (elapsed_s - before_s) if elapsed_s > before_s else 0.0
        line = f"{elapsed_s:5.1f} of {length_s:.0f} s: {live.total} requests answered, {rate:.0f}/s, {failed} failed"
        if not live.total:
            return line
        times = ", ".join(f"{name} {live.quantile_ms(share) or 0.0:.3g}" for name, share in _QUANTILES)
        return f"{line}; {times}, max {live.highest_ns / 1e6:.3g} ms"

    def end(self) -> None:
        """Go on below a line that was renewed."""
        if self._open:
            sys.stderr.write("\n")
            self._open = False
