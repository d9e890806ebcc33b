"""Make a contract pack from an API's description: rules for every web API, and the description's own."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, Final

from conformance.commandline.given_files import read_json, read_octets
from conformance.commandline.out_folder import own_folder, write_atomically, write_json
from conformance.commandline.secrecy import SECRETS
from conformance.contract.locating import MANIFEST
from conformance.contract.toml_file import basic_string

DOCUMENT_NAME: Final = "openapi.json"
ORIGINAL_NAME: Final = "original.json"
UNRESOLVED_NAME: Final = "unresolved.json"
# Files of a description that a run writes into its result. They are data; no other file is read from there.
_DATA_NAMES: Final = (DOCUMENT_NAME, ORIGINAL_NAME, UNRESOLVED_NAME, "wsdl.json")
_MOST_MANIFEST: Final = 64 * 1024
#: The contract's name in verdicts: "keeps its own description".
TITLE: Final = "its own description"
#: The class that a motion map claims.
MOTION: Final = "motion"
#: The class that a ROS map claims.
ROS: Final = "ros-gateway"
#: The class that a state map claims.
STATES: Final = "states"
#: The class of a device that is known by its WSDL.
SOAP: Final = "soap"
#: Class for the behaviour of the web server, as opposed to the application's.
WEB_SERVER: Final = "web-server"
_CLASSES: Final = ("description", "robustness", "http", WEB_SERVER)
# Media types of structured data: a device may offer the same value in several of them.
_DATA: Final = re.compile(r"[/+](?:x-)?(?:json|xml|yaml)\b")
_NO_NAME: Final = re.compile(r"[^a-z0-9]+")


def write_described_pack(
    folder: Path,
    document: Mapping[str, Any],
    original: Mapping[str, Any],
    unresolved: tuple[str, ...] = (),
    *,
    mapped: Collection[str] = (),
) -> Path:
    """Write a contract pack for a description; return its folder.

    Args:
        folder: where; made if it is not there.
        document: the description as one OpenAPI 3 document.
        original: the description as it was read.
        unresolved: references to other files that lead nowhere.
        mapped: the classes that maps in the statement claim.

    Raises:
        OSError: it cannot be written.
    """
    own_folder(folder)
    info = document.get("info")
    info = info if isinstance(info, dict) else {}
    name = _NO_NAME.sub("-", str(info.get("title", "api")).lower()).strip("-") or "api"
    SECRETS.spare(name)
    taken, sent = _formats(document)
    more = {
        **dict.fromkeys(mapped, True),
        "rest-formats": sent > 1,
        "xml-security": any("xml" in name for name in taken),
    }
    classes = [*_CLASSES, *(name for name, there in more.items() if there)]
    lines = [
        f"name = {basic_string(name)}",
        f"version = {basic_string(str(info.get('version', '')) or '0')}",
        f"title = {basic_string(TITLE)}",
        "closed_answers = true",
        "described = true",
        *(f'\n[[class]]\nname = "{class_}"' for class_ in classes),
    ]
    write_atomically(folder / MANIFEST, "\n".join(lines) + "\n")
    for file, content in (
        (DOCUMENT_NAME, document), (ORIGINAL_NAME, original), (UNRESOLVED_NAME, list(unresolved)),
    ):  # fmt: skip
        # Indented, because reports point to lines of the description.
        write_json(folder / file, content, indent=1 if file == DOCUMENT_NAME else None, ensure_ascii=False)
    return folder


def copy_as_data(pack: Path, folder: Path, readable: Callable[[dict[str, Any]], dict[str, Any]]) -> Path:
    """Copy a described pack from a result of unknown origin, without anything that could be executed.

    Args:
        pack: the folder in the result.
        folder: where; it is there.
        readable: returns a description without what a run leaves out, which whoever edited the file may have put in.

    Returns:
        The folder of the copy.

    Raises:
        OSError, ValueError, KeyError, TypeError: the pack is malformed.
    """
    given = tomllib.loads(read_octets(pack / MANIFEST, most=_MOST_MANIFEST).decode("utf-8"))
    lines = [f"{key} = {basic_string(str(given[key]))}" for key in ("name", "version", "title")]
    lines += ["closed_answers = true", "described = true"]
    lines += [f"without = {json.dumps([str(item) for item in given.get('without', ())])}"]
    lines += [f"\n[[class]]\nname = {basic_string(str(item['name']))}" for item in given["class"]]
    (folder / MANIFEST).write_text("\n".join(lines) + "\n", encoding="utf-8")
    for file in (path for path in map(pack.joinpath, _DATA_NAMES) if path.exists()):
        content = read_json(read_octets(file))
        if file.name == DOCUMENT_NAME and isinstance(content, dict) and isinstance(content.get("paths"), dict):
            content = readable(content)
        (folder / file.name).write_text(json.dumps(content), encoding="utf-8")
    return folder


def _formats(document: Mapping[str, Any]) -> tuple[set[str], int]:
    """Return the media types that the operations take, and the most that one response of a success has."""
    taken: set[str] = set()
    sent = 0
    for path, item in document.get("paths", {}).items():
        for operation in item.values() if isinstance(item, dict) else ():
            if not isinstance(operation, dict):
                continue
            taken |= _content(operation.get("requestBody"))
            responses = operation.get("responses")
            for status, response in responses.items() if isinstance(responses, dict) else ():
                formats = _content(response) if str(status)[0] == "2" else set()
                # With a parameter in the path, only formats of data are requested: the thing may be gone before a
                # second request.
                formats = {text for text in formats if _DATA.search(text)} if "{" in str(path) else formats
                sent = max(sent, len(formats))
    return taken, sent


def _content(value: Any) -> set[str]:
    content = value.get("content") if isinstance(value, dict) else None
    return set(content) if isinstance(content, dict) else set()
