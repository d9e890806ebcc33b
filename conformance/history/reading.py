"""Read a history that may be cut short, as after a kill, or come from anybody."""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import msgspec

from conformance.commandline.given_files import read_octets
from conformance.history.events import VERSION, Began, Event

_MOST: Final = 512 << 20
# Octets of all events, unpacked, and of one of them: a request and a response of 1 MiB each, escaped and in base64.
_MOST_UNPACKED: Final = 4 << 30
_MOST_LINE: Final = 64 << 20
_PIECE: Final = 1 << 20


class HistoryError(ValueError):
    """Raised for a file that is no history; the message says why."""


def read_history(path: Path) -> Iterator[Event]:
    """Yield the events of a history, the first of which is Began; a history that is cut short ends earlier.

    Raises:
        HistoryError: it cannot be read, is of a later version, or an event is not well made.
    """
    decoder = msgspec.json.Decoder(Event)
    try:
        for number, line in enumerate(_lines(read_octets(path, _MOST)), 1):
            yield _checked(decoder.decode(line), number)
    except (OSError, ValueError, RecursionError) as error:
        raise HistoryError(f"{path} cannot be read as a history: {error}") from error


def _checked(event: Event, number: int) -> Event:
    if (number == 1) != isinstance(event, Began):
        raise ValueError(f"line {number}: a history has one event `began`, its first")
    if isinstance(event, Began) and event.version > VERSION:
        raise ValueError(f"it is of version {event.version}, and this suite knows {VERSION}")
    return event


def _lines(octets: bytes) -> Iterator[bytes]:
    """Yield the whole lines of gzip data that may be cut short.

    Raises:
        ValueError: it is no gzip data, or holds too much.
    """
    opened, rest, unpacked = zlib.decompressobj(31), b"", 0
    while not opened.eof:
        try:
            piece = opened.decompress(octets, _PIECE)
        except zlib.error as error:
            raise ValueError(f"no gzip data: {error}") from error
        octets = opened.unconsumed_tail
        if not piece:
            return  # the process that wrote it was killed
        unpacked += len(piece)
        *lines, rest = (rest + piece).split(b"\n")
        if unpacked > _MOST_UNPACKED or len(rest) > _MOST_LINE:
            raise ValueError("it holds more than a run writes")
        yield from lines
