"""A request as a resource or service sees it, and its answer. Plain ASGI: the paths here are the hot ones."""

from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

from reference_robot.webservices.representation.problems import Problem

BODY_LIMIT: Final = 1024 * 1024  # octets; the contract allows 64 KiB to 10 MiB

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Field = tuple[bytes, bytes]

# Fields of which a request has at most one (RFC 9110 5.3; 9112 3.2 for Host).
_SINGLE: Final = frozenset({b"host", b"content-type", b"content-length", b"authorization"})


class ClientVanishedError(Exception):
    """The client went away before its request was complete: there is nobody to answer."""


class Request:
    """One HTTP request.

    Attributes:
        method: As sent, in upper case.
        path: The raw path, percent-encoding and all, in octets.
        query: The raw query, without its question mark.
        headers: Field values by lower-case name; several lines of one field are joined by a comma.
    """

    __slots__ = ("_receive", "headers", "method", "path", "query")

    def __init__(self, scope: Message, receive: Receive) -> None:
        """Take over an ASGI scope.

        Raises:
            Problem: 400 for a missing or repeated Host (RFC 9112 3.2) or another repeated single field, 413 for a
                declared length beyond the limit.
        """
        self.method: str = scope["method"]
        self.path: bytes = scope["raw_path"]
        self.query: bytes = scope["query_string"]
        self._receive = receive
        fields: list[Field] = scope["headers"]
        self.headers = headers = dict(fields)
        if len(headers) != len(fields):
            self.headers = headers = _joined(fields)
        if b"host" not in headers and scope["http_version"] == "1.1":
            raise Problem(400, "the request has no Host field (RFC 9112 3.2)")
        length = headers.get(b"content-length")
        if length is not None and int(length) > BODY_LIMIT:  # the HTTP parser let only digits through
            raise _too_large(f"{int(length)} octets")

    async def body(self) -> bytes:
        """Return the whole content.

        Raises:
            Problem: 413 beyond the limit, 415 for a content coding.
            ClientVanishedError: The connection ended first.
        """
        coding = self.headers.get(b"content-encoding", b"identity")
        if coding.strip().lower() != b"identity":
            raise Problem(
                415,
                f"Content-Encoding {coding.decode('latin-1')[:80]!a} is not read here",
                ((b"accept-encoding", b"identity"),),
            )
        message = await self._receive()
        if message["type"] == "http.request" and not message["more_body"]:
            content: bytes = message["body"]  # nearly every request: all in one piece
        else:
            content = await self._rest(message)
        if len(content) > BODY_LIMIT:
            raise _too_large("the content")
        return content

    async def _rest(self, message: Message) -> bytes:
        content = bytearray()
        while message["type"] == "http.request":
            content += message["body"]
            if len(content) > BODY_LIMIT:
                raise _too_large("the content")
            if not message["more_body"]:
                return bytes(content)
            message = await self._receive()
        raise ClientVanishedError


class Response:
    """One answer: status, header fields in order, and content."""

    __slots__ = ("body", "headers", "status")

    def __init__(self, status: int, headers: tuple[Field, ...] = (), body: bytes = b"") -> None:
        self.status = status
        self.headers = headers
        self.body = body


def content(status: int, media_type: str, body: bytes, headers: tuple[Field, ...] = ()) -> Response:
    """Return an answer with content and the fields that describe it."""
    kind = f"{media_type}; charset=utf-8" if media_type.startswith("text/") else media_type
    length = b"%d" % len(body)
    return Response(status, ((b"content-type", kind.encode()), (b"content-length", length), *headers), body)


def _joined(fields: list[Field]) -> dict[bytes, bytes]:
    headers: dict[bytes, bytes] = {}
    for name, value in fields:
        if name not in headers:
            headers[name] = value
        elif name in _SINGLE:
            raise Problem(400, f"the field {name.decode('latin-1')} occurs more than once (RFC 9110 5.3)")
        else:
            headers[name] += b", " + value
    return headers


def _too_large(what: str) -> Problem:
    return Problem(413, f"{what} exceeds the limit of {BODY_LIMIT} octets")
