"""Read files that come from somebody else: regular files of a limited size, and nothing outside the folder given."""

import json
import os
import stat
import zlib
from pathlib import Path
from typing import Any, Final, NoReturn

#: Longest result file, bytes.
MOST: Final = 64 * 1024 * 1024
#: Most JSON values in a result file, estimated by its commas and brackets.
_MOST_NODES: Final = 5_000_000
_PIECE: Final = 1024 * 1024
# Flags for opening: reading a pipe without a writer must not block.
_FLAGS: Final = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


def read_octets(path: Path, most: int = MOST) -> bytes:
    """Return the content of a regular file.

    Raises:
        OSError: it cannot be read, is no regular file, has more than ``most`` octets, or is a link out of its folder.
    """
    try:
        outside = not path.resolve().is_relative_to(path.parent.resolve())
    except RuntimeError as error:  # symbolic links in a circle
        raise OSError(str(error)) from error
    if outside:
        raise OSError(f"it is a link to a file outside {path.parent}")
    # An opener, because a descriptor opened before would leak if the path is no readable file.
    with open(path, "rb", opener=lambda name, _: os.open(name, _FLAGS)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError("it is no regular file")
        octets = file.read(most + 1)
    if len(octets) > most:
        raise OSError(f"it has more than {most:,} octets")
    return octets


def unzipped(octets: bytes, most: int = MOST) -> bytes:
    """Return the content of gzip data (RFC 1952).

    Raises:
        ValueError: it is no gzip data, or holds more than ``most`` octets.
    """
    opened = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    try:
        content = opened.decompress(octets, most + 1)
    except zlib.error as error:
        raise ValueError(f"no gzip data: {error}") from error
    if len(content) > most:
        raise ValueError(f"unpacked, it has more than {most:,} octets")
    if not opened.eof:
        raise ValueError("gzip data that is cut short")
    return content


def read_json(octets: bytes) -> Any:
    """Return the value of a JSON text (RFC 8259).

    Raises:
        ValueError: it is no JSON, is nested too deeply, or has too many values.
    """
    if sum(map(octets.count, (b",", b"[", b"{"))) > _MOST_NODES:
        raise ValueError(f"it has more than {_MOST_NODES:,} values")
    try:
        return json.loads(octets.decode("utf-8"), parse_constant=_refuse)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")
