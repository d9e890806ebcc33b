"""The base class of all REST resources, and the reading and writing of their representations."""

from collections.abc import Awaitable, Callable
from typing import Any, Final

from reference_robot.webservices.http.messages import Request, Response, choose_type, content
from reference_robot.webservices.representation.reading import read
from reference_robot.webservices.representation.shapes import Record
from reference_robot.webservices.representation.writing import JSON, TEXT, XML, write_json, write_text, write_xml

FORMATS: Final = (JSON, XML, TEXT)
NO_CONTENT: Final = Response(204)

_LIVE: Final = ((b"vary", b"accept"), (b"cache-control", b"no-store"))


class Resource:
    """A REST resource: a path, and a method ``get``, ``put`` or ``delete`` for each supported HTTP method.

    Each method returns a response or an awaitable of it, and raises a Problem for an error response.
    """

    path: str

    def handlers(self) -> dict[str, Callable[[Request], Response | Awaitable[Response]]]:
        """Return the handlers by HTTP method; HEAD uses the handler of GET (RFC 9110 9.3.2)."""
        offered = {name.upper(): getattr(self, name) for name in ("get", "put", "delete") if hasattr(self, name)}
        return offered | ({"HEAD": offered["GET"]} if "GET" in offered else {})


def wanted_format(request: Request) -> str:
    """Return the media type that the client prefers; raise the Problem 406 if none is acceptable."""
    return choose_type(request.headers.get(b"accept"), FORMATS)


def represent(
    plain: Any, root: str, media_type: str, status: int = 200, headers: tuple[tuple[bytes, bytes], ...] = ()
) -> Response:
    """Return a response with a dict or list as JSON, XML or text; ``root`` names the XML root element, the ROS type."""
    if media_type == JSON:
        body = write_json(plain)
    elif media_type == XML:
        body = write_xml(plain, root)
    else:
        body = write_text(plain)
    return content(status, media_type, body, (*_LIVE, *headers))


def body_of(request: Request, shape: Record) -> dict[str, Any]:
    """Return the JSON or XML request body as a dict of the required shape; raise the Problem 415, 400 or 422."""
    return read(request.content(), request.headers.get(b"content-type"), shape)
