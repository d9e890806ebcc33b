"""Make a contract pack from a WSDL: its operations, and the documents that describe them."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from conformance.commandline.out_folder import own_folder, write_atomically, write_json
from conformance.contract.described import SOAP, TITLE, WEB_SERVER
from conformance.contract.locating import MANIFEST
from conformance.contract.pack import Contract
from conformance.contract.toml_file import basic_string
from conformance.documents.wsdl import SoapOperation, SoapPort, Wsdl, read_services
from conformance.documents.xml import local
from conformance.documents.xsd_json import schema_of
from conformance.documents.xsd_shapes import Element

#: File with the documents of a WSDL by location, and the first of them.
DOCUMENTS_NAME: Final = "wsdl.json"
# First words of operations that only read. Others that sound so may move: FindHome, SearchReference.
_READS: Final = re.compile(r"(?:[Gg]et|[Ll]ist|[Dd]escribe)(?![a-z])")
# First words of operations that create a thing, and of one that updates such a thing, or the device itself.
_CREATES: Final = re.compile(r"(?i:create|add|register|insert|new|store|put)(?=[A-Z])")
_UPDATES: Final = re.compile(r"(?i:update)(?=[A-Z])")
# The first child of a Body, whatever the prefixes.
_PAYLOAD: Final = re.compile(rb"<(?:[\w.-]+:)?Body\b[^>]*>\s*<(?:[\w.-]+:)?([\w.-]+)")


def label_of(port: SoapPort, operation: SoapOperation) -> str:
    """Return how an operation is called in patterns and on pages: as if it were a resource of its port."""
    return f"POST /{port.name}/{operation.name}"


def write_soap_pack(
    folder: Path,
    found: Wsdl,
    location: str,
    documents: Mapping[str, bytes],
    address: str = "",
    *,
    named: Mapping[str, str] | None = None,
    foreign: bool = False,
    mapped: Collection[str] = (),
) -> Path:
    """Write a contract pack for a WSDL; return its folder.

    Args:
        folder: where; made if it is not there.
        found: what the WSDL describes.
        location: the location of the WSDL.
        documents: all documents by location.
        address: where the service is, whatever the WSDL says; empty means what it says.
        named: locations of schemas that were found by their namespace.
        foreign: whether the WSDL is not the device's own.
        mapped: the classes that maps in the statement claim.

    Raises:
        OSError: it cannot be written.
    """
    own_folder(folder)
    lines = [
        f"name = {basic_string(re.sub(r'[^a-z0-9]+', '-', found.name.lower()).strip('-') or 'soap')}",
        'version = "0"',
        f"title = {basic_string(TITLE)}",
        "closed_answers = true",
        "described = true",
        *(f'\n[[class]]\nname = "{class_}"' for class_ in (SOAP, WEB_SERVER, *mapped)),
    ]
    write_atomically(folder / MANIFEST, "\n".join(lines) + "\n")
    write_json(folder / "openapi.json", _operations(found))
    texts = {place: text.decode("latin-1") for place, text in documents.items()}
    kept = {"location": location, "address": address, "documents": texts, "named": named or {}, "foreign": foreign}
    write_json(folder / DOCUMENTS_NAME, kept)
    return folder


def _operations(found: Wsdl) -> dict[str, Any]:
    """Return the operations in the same form as those of other APIs."""
    paths: dict[str, Any] = {}
    created = {_CREATES.sub("", one.name, 1) for _, one in each(found.ports) if _CREATES.match(one.name)}
    for port, operation in each(found.ports):
        marks = {"x-roaas-reads": True} if _READS.match(operation.name) else {}
        verb = _UPDATES.match(operation.name)
        marks |= {"x-roaas-created": True} if verb and operation.name[verb.end() :] in created else {}
        marks |= {"x-roaas-never": True} if found.remark(operation) else {}
        paths[label_of(port, operation).partition(" ")[2]] = {
            "post": {
                "operationId": operation.name,
                "tags": [port.name],
                "responses": _statuses(port, operation),
                **marks,
            }
        }
    return {"openapi": "3.1.0", "info": {"title": found.name, "version": ""}, "paths": paths}


def with_messages(found: Wsdl, values: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    """Return the operations with the schemas of their messages, as if they were JSON.

    Args:
        found: what the WSDL describes.
        values: what members of requests may have, by name.
    """
    document = _operations(found)
    for port, operation in each(found.ports):
        item = document["paths"][label_of(port, operation).partition(" ")[2]]["post"]
        # A fault that is declared says that the operation may refuse a message.
        item |= {"description": operation.documentation, "responses": {"400": {}} if operation.faults else {}}
        sent, told = (found.types.shape(tag) if tag else None for tag in (operation.request, operation.response))
        if sent is not None:
            item["requestBody"] = {"content": {"application/json": {"schema": schema_of(sent, given=values, branch=0)}}}
        if told is not None:
            content = {"application/json": {"schema": schema_of(told, given={}, branch=0)}}
            item["responses"]["200"] = {"description": "", "content": content}
    return document


def _statuses(port: SoapPort, operation: SoapOperation) -> dict[str, Any]:
    """Return the statuses that SOAP's HTTP binding knows (SOAP 1.1, 6.2; SOAP 1.2 Part 2, 7.5)."""
    known = [*(["202"] if operation.response is None else []), "200", *(["400"] if port.is_12 else []), "500"]
    return {status: {"description": ""} for status in known}


def label_in(found: Wsdl, path: str, body: bytes) -> str | None:
    """Return the operation that a message to a path is for, or None."""
    payload = _PAYLOAD.search(body)
    name = payload[1].decode() if payload else ""
    own = (pair for pair in each(found.ports) if urlsplit(pair[0].url).path == path)
    return next((label_of(port, operation) for port, operation in own if local(operation.request) == name), None)


def each(ports: Iterable[SoapPort]) -> Iterable[tuple[SoapPort, SoapOperation]]:
    """Yield each operation with its port."""
    return ((port, operation) for port in ports for operation in port.operations)


@lru_cache(maxsize=4)
def own_wsdl(contract: Contract) -> str:
    """Return the URL of a pack's WSDL; empty if it came from a file, or the pack has none."""
    path = contract.directory / DOCUMENTS_NAME
    location = str(json.loads(path.read_text(encoding="utf-8"))["location"]) if path.is_file() else ""
    return location if urlsplit(location).scheme in {"http", "https"} else ""


@lru_cache(maxsize=4)
def services_of(contract: Contract) -> Wsdl | None:
    """Return the services that a pack's WSDL describes, or None.

    Raises:
        WsdlError: it describes no service.
    """
    path = contract.directory / DOCUMENTS_NAME
    if not path.is_file():
        return None
    kept = json.loads(path.read_text(encoding="utf-8"))
    documents: dict[str, bytes] = {place: text.encode("latin-1") for place, text in kept["documents"].items()}

    def fetch(place: str) -> bytes:
        if place not in documents:
            raise ValueError("it was not there when the WSDL was read")
        return documents[place]

    return read_services(
        documents[kept["location"]],
        kept["location"],
        fetch,
        kept["address"],
        lambda space: str(kept["named"].get(space, "")),
        foreign=kept["foreign"],
    )


def messages_of(contract: Contract) -> dict[str, Element]:
    """Return the declarations of the requests of a pack's WSDL, by operation; empty if the pack has none."""
    found = services_of(contract)
    if found is None:
        return {}
    shapes = ((label_of(port, one), found.types.shape(one.request)) for port, one in each(found.ports) if one.request)
    return {label: shape for label, shape in shapes if shape is not None}
