"""Remove this machine's folders from words that a result shows: command lines, names of files."""

import re
import shlex
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

#: The folders of an absolute path, wherever in a word it begins; addresses such as http://host/path are none.
_FOLDERS = re.compile(r"(?<![\w:/.~-])(?:file://)?~?/(?:[^\s/]+/)*")


def without_folders(word: str) -> str:
    """Return a word with paths relative to the working directory; of a file elsewhere, only the name.

    `--out=/home/me/tests/out/new` becomes `--out=out/new` in /home/me/tests, and `--out=new` in other folders.
    """
    here = re.escape(f"{Path.cwd().as_posix().rstrip('/')}/")
    return _FOLDERS.sub("", re.sub(rf"(?<![\w:/.~-])(?:file://)?{here}(?=[^\s/])", "", word))


def command_without_folders(words: Sequence[str], patterns: Sequence[str] = ()) -> str:
    """Return the command that repeats a run.

    Args:
        words: the words after `roaas`.
        patterns: options whose values are no files, but may look so: `--call /api/move`.
    """
    shown = (
        word if before in patterns or word.partition("=")[0] in patterns else without_folders(word)
        for before, word in pairwise(["roaas", *words])
    )
    return shlex.join(["roaas", *shown])
