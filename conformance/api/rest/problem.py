"""Problem details (RFC 9457): the content of an error response."""

import re
from typing import Any, Final

from conformance.documents.json_text import read_json
from conformance.documents.representation import UnreadableError, local_name, parse_xml
from conformance.transport.exchange import Response

JSON: Final = "application/problem+json"
XML: Final = "application/problem+xml"


def members_of(answer: Response) -> dict[str, Any] | None:
    """Return the members of a problem, status as a number; None where the problem cannot be read."""
    if answer.media_type == XML:
        try:
            root = parse_xml(answer.body)
        except UnreadableError:
            return None
        members: dict[str, Any] = {
            local_name(child): (child.text or "") for child in root if isinstance(child.tag, str)
        }
        status = str(members.get("status", "")).strip()
        if re.fullmatch(r"[+-]?\d{1,9}", status, re.ASCII):
            members["status"] = int(status)
        return members
    value = read_json(answer.body).value
    return value if isinstance(value, dict) else None


def detail_of(answer: Response) -> str:
    """Return the detail of a problem document, or an empty text."""
    members = members_of(answer) or {}
    detail = members.get("detail")
    return detail if isinstance(detail, str) else ""


def names(detail: str, *words: str) -> bool:
    """Return whether a problem's detail contains one of the field names as a whole word."""
    return any(re.search(rf"(?<![A-Za-z0-9_]){re.escape(word)}(?![A-Za-z0-9_])", detail) for word in words)
