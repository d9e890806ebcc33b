"""Error responses as problem details (RFC 9457)."""

from http import HTTPStatus
from typing import Final

from lxml import etree

from reference_robot.webservices.representation.writing import text_of, write_json

PROBLEM_JSON: Final = "application/problem+json"
PROBLEM_XML: Final = "application/problem+xml"

_NAMESPACE: Final = "urn:ietf:rfc:7807"  # RFC 9457 appendix B keeps the namespace of RFC 7807


class Problem(Exception):  # noqa: N818 - RFC 9457's own name for it
    """An error response: 4xx for errors of the client, 5xx for the robot's; the detail names field and value."""

    def __init__(self, status: int, detail: str, headers: tuple[tuple[bytes, bytes], ...] = ()) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = headers

    def members(self) -> dict[str, str | int]:
        """Return the members of the problem details object (RFC 9457 3.1): type, title, status, detail."""
        return {
            "type": "about:blank",
            "title": HTTPStatus(self.status).phrase,
            "status": self.status,
            "detail": self.detail,
        }

    def written(self, media_type: str) -> bytes:
        """Return the problem as a body of media type application/problem+json or application/problem+xml."""
        if media_type == PROBLEM_JSON:
            return write_json(self.members())
        root = etree.Element("problem", xmlns=_NAMESPACE)
        for name, value in self.members().items():
            etree.SubElement(root, name).text = text_of(value)
        return etree.tostring(root, encoding="utf-8", xml_declaration=True)


def not_yet(detail: str) -> Problem:
    """Return the Problem 503 with Retry-After for a temporary inability of the robot (RFC 9110 15.6.4)."""
    return Problem(503, detail, ((b"retry-after", b"1"),))
