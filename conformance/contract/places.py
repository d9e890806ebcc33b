"""Line numbers of requirements and claims in their files, for reports that point to them.

TOML parsers discard line numbers, so the two files are searched as text.
"""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from conformance.contract.generic import LEDGER
from conformance.contract.locating import GENERIC_RULES
from conformance.contract.pack import Contract

_TABLE = re.compile(r'\s*\[\s*"?([\w-]+)"?\s*\.\s*"?([\w-]+)"?\s*\]')
_CLAIMS = re.compile(r"^\s*\[\s*claims\s*\]", re.MULTILINE)
_NEXT_TABLE = re.compile(r"^\s*\[[\w\s\"'.-]+\]\s*(?:#.*)?$", re.MULTILINE)
# A key of a mapping at the beginning of a line, in JSON or YAML.
_KEY = re.compile(r"""\s*["']?(/[^"'\s]*|[a-z]+)["']?\s*:(?:\s|$)""")
_METHODS = frozenset({"get", "head", "options", "put", "post", "patch", "delete", "trace", "query"})
_NAME = re.compile(r"[\"']([\w-]+)[\"']")


def places(
    contract: Contract, statement: Path | None, description: Path | None = None, labels: Iterable[str] = ()
) -> dict[str, Any]:
    """Return the ``places`` of result.json: lines in the ledgers, in the statement, and in the device's description.

    Lines count from 1. Files are named relative to the working directory if they are below it.

    Args:
        contract: what the device is judged by.
        statement: the statement's file, or None.
        description: the description's file, or None.
        labels: its operations, each as method and path.
    """
    own, generic = contract.directory / LEDGER, GENERIC_RULES / LEDGER
    return {
        "statement": None if statement is None else {"file": _short_path(statement), **_claim_lines(_text(statement))},
        "ledger": _ledger(own if own.is_file() else generic, contract),
        "generic_ledger": _ledger(generic, contract),
        **({} if description is None else {"description": _lines_of(description, labels)}),
    }


def _lines_of(path: Path, labels: Iterable[str]) -> dict[str, Any]:
    """Return the line of each operation in a description, as JSON or YAML writes its keys on lines of their own."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    keys = [(number, found[1]) for number, line in enumerate(lines, 1) if (found := _KEY.match(line))]
    at: dict[str, int] = {}
    place = ""
    for number, key in keys:
        if key.startswith("/"):
            place = key
        elif place and key in _METHODS:
            at.setdefault(f"{key.upper()} {place}", number)
    return {"file": _short_path(path), "lines": {label: at[label] for label in labels if label in at}}


def _ledger(path: Path, contract: Contract) -> dict[str, Any]:
    lines = {id_: line for id_, line in _ledger_lines(_text(path)).items() if id_ in contract.ledger}
    return {"file": _short_path(path), "lines": lines}


def _ledger_lines(text: str) -> dict[str, int]:
    lines = enumerate(text.split("\n"), 1)
    return {f"{found[1]}/{found[2]}": number for number, line in lines if (found := _TABLE.match(line))}


def _claim_lines(text: str) -> dict[str, Any]:
    """Return the line of the table `[claims]` (1 without one), and of each claimed name in it."""
    table = _CLAIMS.search(text)
    if table is None:
        return {"line": 1, "classes": {}}
    end = _NEXT_TABLE.search(text, table.end())
    names = _NAME.finditer(text, table.end(), end.start() if end else len(text))
    line = _line(text, text.index("[", table.start()))
    return {"line": line, "classes": {found[1]: _line(text, found.start()) for found in names}}


def _line(text: str, offset: int) -> int:
    return text.count("\n", 0, offset) + 1


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _short_path(path: Path) -> str:
    """Return a path relative to the working directory; of a file elsewhere, only folder and name."""
    try:
        return path.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return "/".join(path.resolve().parts[-2:])
