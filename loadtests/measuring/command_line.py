"""Remove secrets and folders from command lines before a result shows them."""

import re

#: The folders of an absolute path, wherever in a word it begins; addresses such as http://host/path are none.
_OPERATION = re.compile(r"(--[a-z]+=)?[A-Z*]+ /")  # the name of an operation, as in GET /state
_FOLDERS = re.compile(r"(?<![\w:/.~-])(?:file://)?~?/(?:[^\s/]+/)*")


def without_folders(word: str) -> str:
    """Return a word of a command line without this machine's folders: `--out=/home/me/out` becomes `--out=out`.

    The path of an operation of an API stays.
    """
    return word if _OPERATION.match(word) else _FOLDERS.sub("", word)
