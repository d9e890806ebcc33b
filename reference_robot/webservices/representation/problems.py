"""Error responses as problem details (RFC 9457)."""

from http import HTTPStatus
from typing import Any, Final

from lxml import etree

from reference_robot.webservices.representation.writing import element_of, write_json

PROBLEM_JSON: Final = "application/problem+json"
PROBLEM_XML: Final = "application/problem+xml"

_NAMESPACE: Final = "urn:ietf:rfc:7807"  # RFC 9457 appendix B keeps the namespace of RFC 7807


class Problem(Exception):  # noqa: N818 - RFC 9457's own name for it
    """An error response: 4xx for errors of the client, 5xx for the robot's; the detail names field and value.

    ``extensions`` are further members of the problem details object (RFC 9457 3.2), by name.
    """

    def __init__(
        self,
        status: int,
        detail: str,
        headers: tuple[tuple[bytes, bytes], ...] = (),
        extensions: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = headers
        self.extensions = extensions or {}

    def members(self) -> dict[str, Any]:
        """Return the members of the problem details object: type, title, status, detail, and extensions."""
        return {
            "type": "about:blank",
            "title": HTTPStatus(self.status).phrase,
            "status": self.status,
            "detail": self.detail,
            **self.extensions,
        }

    def written(self, media_type: str) -> bytes:
        """Return the problem as a body of media type application/problem+json or application/problem+xml."""
        if media_type == PROBLEM_JSON:
            return write_json(self.members())
        root = etree.Element("problem", xmlns=_NAMESPACE)
        root.extend([element_of(value, name) for name, value in self.members().items()])
        return etree.tostring(root, encoding="utf-8", xml_declaration=True)


def not_yet(detail: str) -> Problem:
    """Return the Problem 503 with Retry-After for a temporary inability of the robot (RFC 9110 15.6.4)."""
    return Problem(503, detail, ((b"retry-after", b"1"),))
