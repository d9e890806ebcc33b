"""Atomic writing of files."""

import secrets
from pathlib import Path


def write_atomically(path: Path, text: str) -> Path:
    """Write a file so that a reader sees either the old content or the whole new content; return its path.

    The temporary file is opened like any other, so that its mode follows the umask.

    Raises:
        OSError: the file cannot be written; the old content is kept, and no temporary file remains.
    """
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with draft.open("x", encoding="utf-8") as file:
            file.write(text)
        return draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
