"""Whether a body is what its media type says, as far as that is JSON or XML."""

from __future__ import annotations

from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, is_xml


def unreadable(media_type: str, body: bytes) -> str:
    """Return why a parser cannot read a body of JSON or XML; empty where it can, and for every other media type."""
    if is_json(media_type):
        return read_json(body).unreadable
    if not is_xml(media_type):
        return ""
    # Imported late: lxml costs a tenth of a second that --help need not pay.
    from conformance.documents.xml import NotXmlError, parse  # noqa: PLC0415

    try:
        parse(body, doctype=True)
    except NotXmlError as error:
        return str(error)
    return ""
