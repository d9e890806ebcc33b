"""Line numbers of requirements and claims in their files, for reports that point to them.

TOML parsers discard line numbers, so the two files are searched as text.
"""

import re
from pathlib import Path
from typing import Any

from conformance.contract.generic import LEDGER
from conformance.contract.locating import GENERIC_RULES
from conformance.contract.pack import Contract

_TABLE = re.compile(r'^\s*\[\s*"?([\w-]+)"?\s*\.\s*"?([\w-]+)"?\s*\]', re.MULTILINE)
_CLAIMS = re.compile(r"^\s*\[\s*claims\s*\]", re.MULTILINE)
_NEXT_TABLE = re.compile(r"^\s*\[[\w\s\"'.-]+\]\s*(?:#.*)?$", re.MULTILINE)
_NAME = re.compile(r"[\"']([\w-]+)[\"']")


def places(contract: Contract, statement: Path | None) -> dict[str, Any]:
    """Return the ``places`` of result.json: lines in the ledgers, and in the statement if there is one.

    Lines count from 1. Files are named relative to the working directory if they are below it.
    """
    own, generic = contract.directory / LEDGER, GENERIC_RULES / LEDGER
    return {
        "statement": None if statement is None else {"file": _shown(statement), **_claim_lines(_text(statement))},
        "ledger": _ledger(own if own.is_file() else generic, contract),
        "generic_ledger": _ledger(generic, contract),
    }


def _ledger(path: Path, contract: Contract) -> dict[str, Any]:
    lines = {id_: line for id_, line in _ledger_lines(_text(path)).items() if id_ in contract.ledger}
    return {"file": _shown(path), "lines": lines}


def _ledger_lines(text: str) -> dict[str, int]:
    return {f"{found[1]}/{found[2]}": _line(text, found.start(1)) for found in _TABLE.finditer(text)}


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


def _shown(path: Path) -> str:
    """Return a path relative to the working directory; of a file elsewhere, only folder and name."""
    try:
        return path.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return "/".join(path.resolve().parts[-2:])
