"""Check whether a JSON or XML body can be parsed."""

from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, is_xml


def unreadable(media_type: str, body: bytes) -> str:
    """Return why a JSON or XML body cannot be parsed; empty if it can, and for other media types."""
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
