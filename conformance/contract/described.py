"""A contract pack made from an API's own description: what binds every web API, and what the description says."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from conformance.contract.locating import MANIFEST
from conformance.contract.toml_file import basic_string

ORIGINAL_NAME: Final = "original.json"
UNRESOLVED_NAME: Final = "unresolved.json"
#: How the contract is called in verdicts: "keeps its own description".
TITLE: Final = "its own description"
_CLASSES: Final = ("description", "robustness", "http", "rest-formats")
# The class `description` judges these of each operation, and tells what operations have in common once.
_WITHOUT: Final = ("http/declared-status", "http/declared-body", "http/json-integers", "http/no-traceback")
_NO_NAME: Final = re.compile(r"[^a-z0-9]+")


def write_described_pack(
    folder: Path, document: Mapping[str, Any], original: Mapping[str, Any], unresolved: tuple[str, ...] = ()
) -> Path:
    """Write a contract pack for a description; return its folder.

    Args:
        folder: where; made if it is not there.
        document: the description as one OpenAPI 3 document.
        original: the description as it was read.
        unresolved: references to other files that lead nowhere.

    Raises:
        OSError: it cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    info = document.get("info")
    info = info if isinstance(info, dict) else {}
    name = _NO_NAME.sub("-", str(info.get("title", "api")).lower()).strip("-") or "api"
    classes = [*_CLASSES, *(("xml-security",) if _takes_xml(document) else ())]
    lines = [
        f"name = {basic_string(name)}",
        f"version = {basic_string(str(info.get('version', '')) or '0')}",
        f"title = {basic_string(TITLE)}",
        "closed_answers = true",
        "described = true",
        f"without = {json.dumps(list(_WITHOUT))}",
        *(f'\n[[class]]\nname = "{class_}"' for class_ in classes),
    ]
    (folder / MANIFEST).write_text("\n".join(lines) + "\n", encoding="utf-8")
    for file, content in (
        ("openapi.json", document), (ORIGINAL_NAME, original), (UNRESOLVED_NAME, list(unresolved)),
    ):  # fmt: skip
        (folder / file).write_text(json.dumps(content, ensure_ascii=False), encoding="utf-8")
    return folder


def _takes_xml(document: Mapping[str, Any]) -> bool:
    """Return whether an operation takes XML."""
    for item in document.get("paths", {}).values():
        for operation in item.values() if isinstance(item, dict) else ():
            body = operation.get("requestBody") if isinstance(operation, dict) else None
            content = body.get("content") if isinstance(body, dict) else None
            if isinstance(content, dict) and any("xml" in name for name in content):
                return True
    return False
