"""Atomic writing of files, with variables in place of secrets."""

import json
import secrets
from pathlib import Path
from typing import Any

from conformance.commandline.secrecy import SECRETS


def write_atomically(path: Path, text: str) -> Path:
    """Write a file so that a reader sees either the old content or the whole new content; return its path.

    The temporary file is opened like any other, so that its mode follows the umask.

    Raises:
        OSError: the file cannot be written; the old content is kept, and no temporary file remains.
    """
    return _written(path, SECRETS.masked(text))


def write_json(path: Path, value: Any, **options: Any) -> Path:
    """Write JSON atomically; return its path. It stays JSON, whatever in it was a secret.

    Args:
        path: of the file.
        value: its content.
        options: of json.dumps().

    Raises:
        OSError: as above.
    """
    return _written(path, json.dumps(SECRETS.masked_json(value), **options) + "\n")


def _written(path: Path, text: str) -> Path:
    return write_octets(path, text.encode())


def write_octets(path: Path, octets: bytes) -> Path:
    """Write octets, in which nothing is masked, atomically; return the path. A link of that name is replaced.

    Raises:
        OSError: as above.
    """
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with draft.open("xb") as file:
            file.write(octets)
        return draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
