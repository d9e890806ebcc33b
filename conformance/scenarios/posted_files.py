"""Files that a POST stores, such as photos: all bytes come back, whole and in parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import islice
from typing import Final

from conformance.api.rest.inputs import Inputs, request_of, usual_inputs
from conformance.api.rest.variations import Kind, Variation
from conformance.documents.files import file_of, keeps_octets
from conformance.documents.openapi import Operation
from conformance.scenarios.creating import location_of
from conformance.scenarios.neighbours import read_parts
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer

#: Files with bytes that programs take for the end of a line, text or file, each shorter than the one before.
FILES: Final = (
    bytes(range(255, -1, -1)) * 18,
    bytes(range(256)) * 17 + b"\r\n\n \0end",
    b"roaas\r\n\0\r\xff\xfe\n\n\x1a tail \r\n" * 9,
)
_COLLECTIONS = 2  # collections of files that are tried
_TYPES = 3  # media types that are tried for each


def post_files(surveyor: Surveyor, operations: Mapping[tuple[str, str], Operation]) -> None:
    """Store files in each collection that takes them, read them back, and delete them."""
    stores = [
        (create, read, operations.get(("DELETE", f"{template}/{{{parameters[0].name}}}")))
        for (method, template), create in operations.items()
        for (other, path), read in operations.items()
        if method == "POST" and other == "GET" and path.startswith(f"{template}/{{")
        if len(parameters := read.parameter("path")) == 1 and any(map(keeps_octets, create.bodies))
    ]
    for create, read, delete in islice(stores, _COLLECTIONS):
        usual = usual_inputs(create, surveyor.values)[0]
        for media_type in islice(filter(keeps_octets, create.bodies), _TYPES):
            for octets in FILES:
                inputs = replace(usual, body=file_of(media_type, octets), media_type=media_type)
                made = surveyor.send(create, Variation(Kind.ODD, "", "", inputs), request_of(create, inputs)).exchange
                path = location_of(surveyor.api, read, made) if made is not None and made.response.ok else ""
                if not path:
                    break
                whole = replace(request_of(read, usual_inputs(read, surveyor.values)[0]), target=path)
                surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole)
                if "206" in read.responses and octets is FILES[0]:
                    read_parts(surveyor, read, whole)
                if delete is not None:
                    Writer(surveyor.api, surveyor.values).conditional(delete, read, _thing_of(path, read, delete))


def _thing_of(path: str, read: Operation, delete: Operation) -> str:
    """Return the path of a file's thing, by that of its content."""
    below = read.template.count("/") - delete.template.count("/")
    return path.rsplit("/", below)[0] if below else path
