"""Write a history during the run: append-only, compressed, and complete up to the last moment if killed.

A thread of its own encodes, masks and writes, so that recording costs a request next to nothing. What was sent in the
last moments before the process is killed is lost; everything before can be read, as each piece ends at a boundary of
the compressed data (RFC 1951, as zlib's Z_SYNC_FLUSH makes it).
"""

import itertools
import math
import threading
import time
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Final

import msgspec

from conformance.commandline.secrecy import SECRETS
from conformance.history.events import VERSION, Began, Ended, Event, Eye, Seen, Sent, Span, Withdrawn
from conformance.transport.passage import EyeState, Passage, Recorder

HISTORY_NAME: Final = "history.jsonl.gz"
_GZIP: Final = 31
_FAST: Final = 1
# Events are collected this long before they are written, s: at most these are lost.
_GATHERED_S: Final = 0.1
_MOST: Final = 512 << 20  # bytes of a history on disk, ten times those of a long run
_LAST_S: Final = 60.0  # longest wait at the end, s


class HistoryWriter(Recorder):
    """Writes the history of one run.

    Args:
        folder: gets the file ``history.jsonl.gz``; one of an earlier run is replaced.
        suite: version of the suite.
        started: when the run began (RFC 3339).

    Attributes:
        problem: why not everything was written, or empty.
    """

    def __init__(self, folder: Path, suite: str, started: str) -> None:
        self.path, self.problem = folder / HISTORY_NAME, ""
        self._began_s, self._span, self._sent = time.monotonic(), "", 0
        self._number = itertools.count(1).__next__
        self._queue: SimpleQueue[tuple[int, Passage, str, str] | Event | None] = SimpleQueue()
        self._closing = threading.Event()
        self._queue.put(Began(VERSION, suite, started))
        self._thread = threading.Thread(target=self._write, name="history", daemon=True)
        self._thread.start()

    def record(self, passage: Passage) -> int:
        """Add an exchange."""
        number = self._number()
        self._queue.put((number, passage, self._span, threading.current_thread().name))
        return number

    def withdraw(self, number: int) -> None:
        """Add that a response was none to its request."""
        self._queue.put(Withdrawn(number))

    def begin(self, span: str) -> None:
        """Record which check or scenario runs from now on."""
        self._span = span
        self._queue.put(Span(self._since(time.monotonic()), span))

    def saw(self, eye: str, at_s: float, values: Sequence[float | int | str]) -> None:
        """Add an observation of an eye, such as a ROS probe."""
        # JSON has no infinity or NaN.
        told = (str(value) if isinstance(value, float) and not math.isfinite(value) else value for value in values)
        self._queue.put(Seen(self._since(at_s), eye, tuple(told)))

    def eye(self, eye: str, state: EyeState) -> None:
        """Add that an eye sees from now on, or does no longer."""
        self._queue.put(Eye(self._since(time.monotonic()), eye, state))

    def close(self) -> None:
        """Write the remaining events and the end. Afterwards ``problem`` is final."""
        self._queue.put(None)
        self._closing.set()
        self._thread.join(_LAST_S)
        if self._thread.is_alive():
            self.problem = self.problem or f"it was not written within {_LAST_S:g} s"

    def _since(self, moment_s: float) -> float:
        return round(moment_s - self._began_s, 6)

    def _write(self) -> None:
        try:
            self.path.unlink(missing_ok=True)
            with self.path.open("xb", buffering=0) as file:
                packer, octets, ends = zlib.compressobj(_FAST, wbits=_GZIP), 0, False
                while not ends:
                    lines, ends = self._gather()
                    if octets > _MOST:
                        self.problem, lines = f"it has more than {_MOST:,} octets", []
                    if ends:
                        end = Ended(self._since(time.monotonic()), self._sent, self.problem)
                        lines.append(msgspec.json.encode(end))
                    piece = packer.compress(b"".join(line + b"\n" for line in lines))
                    piece += packer.flush(zlib.Z_FINISH if ends else zlib.Z_SYNC_FLUSH)
                    octets += len(piece)
                    while piece:
                        piece = piece[file.write(piece) :]
        except (OSError, MemoryError) as error:
            self.problem = str(error) or type(error).__name__
            # Removing the history leaves room for the result on a full disk.
            with suppress(OSError):
                self.path.unlink(missing_ok=True)
            with suppress(MemoryError):
                while self._queue.get() is not None:
                    pass

    def _gather(self) -> tuple[list[bytes], bool]:
        """Return the events of the next moment as lines, and whether they are the last ones."""
        lines, item = list[bytes](), self._queue.get()
        self._closing.wait(_GATHERED_S)
        while item is not None:
            lines.append(msgspec.json.encode(_mask(self._event(item))))
            if self._queue.empty():
                return lines, False
            item = self._queue.get()
        return lines, True

    def _event(self, item: tuple[int, Passage, str, str] | Event) -> Event:
        if not isinstance(item, tuple):
            return item
        number, passage, span, client = item
        self._sent += 1
        return Sent.of(passage, number, span, client, self._began_s)


def _mask(event: Event) -> object:
    """Return an event with variables in place of secrets, also in bytes before they are encoded."""
    if not SECRETS:
        return event
    return SECRETS.masked_json(msgspec.to_builtins(event, builtin_types=(bytes,)))
