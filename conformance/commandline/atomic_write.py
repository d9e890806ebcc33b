"""A file that is there whole or not at all."""

import secrets
from pathlib import Path


def write_atomically(path: Path, text: str) -> Path:
    """Write a file beside its name and put it in place: a reader sees the old one or the new one, whole.

    The draft is opened as any file is, so that its mode follows the umask: a result is for whoever may read the folder.

    Returns:
        The path that was given.

    Raises:
        OSError: it cannot be written; what was there before is still there, and no draft is left.
    """
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with draft.open("x", encoding="utf-8") as file:
            file.write(text)
        return draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
