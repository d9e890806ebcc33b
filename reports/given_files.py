"""Read files that come from somebody else: regular files of a limited size, and JSON with limited numbers."""

import json
import math
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NoReturn

from reports.errors import ResultInvalidError, ResultMissingError, ResultUnreadableError
from reports.pages.untrusted import excerpt

MOST_BYTES: Final = 64 << 20
"""How long a result file may be, in bytes; and unpacked, what is compressed in it."""
_MOST_VALUES: Final = 5_000_000
_DIGITS, _OUTSIDE = 20, 1 << 63
# A pipe without a writer must not block.
_READING: Final = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


def read_octets(path: Path, most: int = MOST_BYTES, root: Path | None = None, *, cut: bool = False) -> bytes:
    """Return the content of a regular file, which may come from anybody.

    Args:
        path: the file.
        most: how long it may be, in bytes.
        root: the folder that it must lie in, links followed; None if the file is the user's, wherever it is.
        cut: whether to return the beginning of a file that is too long.

    Raises:
        ResultMissingError: it does not exist.
        ResultUnreadableError: it cannot be read, is no regular file, is too long, or is a link that leads out of
            `root`.
    """
    try:
        if root is not None and not path.resolve().is_relative_to(root.resolve()):
            raise ResultUnreadableError(f"{path}: it is a link to a file outside {root}")
        # An opener, because a descriptor opened before would leak if the path is no readable file.
        with open(path, "rb", opener=lambda name, _: os.open(name, _READING)) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise ResultUnreadableError(f"{path}: it is no regular file")
            octets = file.read(most + (not cut))
    except FileNotFoundError as error:
        raise ResultMissingError(f"{path}: no such file") from error
    except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle
        raise ResultUnreadableError(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    if len(octets) > most:
        raise ResultUnreadableError(f"{path}: it has more than {most:,} bytes")
    return octets


def unzipped(octets: bytes, wbits: int, most: int = MOST_BYTES) -> bytes:
    """Return the content of compressed data (`wbits` as of zlib), at most so many bytes.

    Raises:
        ValueError: it is not compressed like that, is cut short, or holds more.
    """
    opened = zlib.decompressobj(wbits)
    try:
        content = opened.decompress(octets, most + 1)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if len(content) > most or not opened.eof:
        raise ValueError("it is cut short" if len(content) <= most else f"unpacked, it has more than {most:,} bytes")
    return content


def parsed(text: str) -> Any:
    """Return the value of a JSON text, whose numbers are those that a double or 64 bits can hold.

    Raises:
        ValueError: it is no JSON, or holds another number, or too many values.
        RecursionError: it is nested too deeply.
    """
    if sum(map(text.count, ",[{")) > _MOST_VALUES:
        raise ValueError(f"more than {_MOST_VALUES:,} values")
    return json.loads(text, parse_constant=_refuse_constant, parse_int=_whole, parse_float=_real)


@contextmanager
def showing(path: Path | str) -> Iterator[None]:
    """Turn what fails while the content of a valid result is shown into an error that names the file.

    A file from anybody may fit its schema and still hold figures that contradict each other, or that no axis can have.

    Raises:
        ResultInvalidError: something failed.
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        said = excerpt(f"{type(error).__name__}: {error}", 200)
        raise ResultInvalidError(f"{path}: its values fit the schema and cannot be shown: {said}") from error


def _whole(text: str) -> int:
    number = int(text) if len(text) <= _DIGITS else _OUTSIDE
    if abs(number) >= _OUTSIDE:
        raise ValueError(f"a number of {len(text)} digits, more than 64 bits hold")
    return number


def _real(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:40]} is more than a double holds")
    return number


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number (RFC 8259, section 6)")
