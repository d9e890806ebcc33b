"""Results stored by name, which later runs are compared with.

A baseline is a folder of latency.json files, named by when they were measured; the latest one is compared with.
"""

import json
import re
from pathlib import Path

from conformance.commandline.atomic_write import write_atomically

FOLDER = Path(".roaas", "baselines")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_PATTERN = "20*.json"


class BaselineError(ValueError):
    """A baseline that cannot be used; the message says what to do."""


def folder_of(baselines: Path, name: str) -> Path:
    """Return the folder of a baseline.

    Raises:
        BaselineError: the name is not allowed.
    """
    if not _NAME.fullmatch(name):
        raise BaselineError(f"baseline {name!r}: a name consists of letters, digits, '.', '_' and '-'")
    return baselines / name


def newest(folder: Path) -> Path:
    """Return the result that was stored last.

    Raises:
        BaselineError: there is no result.
    """
    stored = sorted(folder.glob(_PATTERN))
    if not stored:
        raise BaselineError(f"there is no baseline in {str(folder)!r}: store one with --save {folder.name}")
    return stored[-1]


def store(result: Path, folder: Path) -> Path | None:
    """Store a result as a baseline and return its path; return None for an invalid result, which cannot be a baseline.

    Raises:
        BaselineError: the folder cannot be written to.
    """
    text = result.read_text(encoding="utf-8")
    document = json.loads(text)
    if not document["valid"]:
        return None
    moment = re.sub(r"[^0-9TZ]", "", document["started"])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return write_atomically(folder / f"{moment}.json", text)
    except OSError as error:
        raise BaselineError(f"baseline folder {str(folder)!r}: {error.strerror or error}") from None
