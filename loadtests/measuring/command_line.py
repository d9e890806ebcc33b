"""Remove secrets and folders from command lines before a result shows them."""

import re

#: The folders of an absolute path, wherever in a word it begins; addresses such as http://host/path are none.
_FOLDERS = re.compile(r"(?<![\w:/.~-])(?:file://)?~?/(?:[^\s/]+/)*")


def without_folders(word: str) -> str:
    """Return a word of a command line without this machine's folders: `--out=/home/me/out` becomes `--out=out`."""
    return _FOLDERS.sub("", word)
