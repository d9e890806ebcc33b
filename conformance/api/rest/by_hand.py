"""Valid requests over a raw socket, verified by h11 before they are sent.

h11 plays the server: bytes that it does not parse as valid requests are never sent as such.
"""

from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import h11

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.transport import raw
from conformance.transport.exchange import Attempt, media_type_of
from conformance.verdict.evidence import HarnessError


def ask(api: RestInterface, method: str, path: str, *fields: str, body: bytes = b"", **how: Any) -> Attempt:
    """Send one valid request over a new raw socket and return the result.

    Args:
        api: the robot's REST interface.
        method: HTTP method.
        path: request target below the base URL.
        fields: whole header lines, without line ends.
        body: body as on the wire, in chunks if the headers say so.
        how: deadline and pauses, as for raw.talk().

    Raises:
        HarnessError: the request is invalid by the contract.
        NoAnswerError: the connection cannot be opened.
    """
    return ask_octets(api, raw.head(api.client, method, path, *fields) + body, method, **how)


def ask_octets(api: RestInterface, octets: bytes, method: str = "GET", **how: Any) -> Attempt:
    """Send the bytes of one valid request and return the result, as ask() does."""
    return raw.read_one(api.client, octets, talk(api, octets, answers=1, **how), method)[0]


def talk(api: RestInterface, octets: bytes, *, answers: int = 0, refused: bool = False, **how: Any) -> raw.RawAnswer:
    """Send bytes of valid requests and return what was received, as raw.talk() does.

    Args:
        api: the robot's REST interface.
        octets: the bytes.
        answers: stop after this number of complete responses to GET.
        refused: whether the requests may be invalid by the contract; they must be complete.
        how: deadline and pauses, as for raw.talk().

    Raises:
        HarnessError: the bytes are not such requests.
        NoAnswerError: the connection cannot be opened.
    """
    for request, body in _requests(octets):
        method, target = request.method.decode(), request.target.decode()
        if not target.startswith("/"):
            parts = urlsplit(target)
            target = parts.path + (f"?{parts.query}" if parts.query else "")
        fields = dict(request.headers)
        media_type = media_type_of(fields.get(b"content-type", b"").decode())
        below = target.removeprefix(api.client.prefix)
        if not refused:
            require_valid(api.run.contract, method, below, media_type, body)
    return raw.talk(api.client, octets, answers=answers, **how)


def _requests(octets: bytes) -> Iterator[tuple[h11.Request, bytes]]:
    """Yield each request in the bytes with its body.

    Raises:
        HarnessError: the bytes are not complete requests.
    """
    while octets:
        server = h11.Connection(h11.SERVER)
        server.receive_data(octets)
        request: h11.Request | None = None
        body = bytearray()
        try:
            while not isinstance(event := server.next_event(), h11.EndOfMessage):
                if isinstance(event, h11.Request):
                    request = event
                elif isinstance(event, h11.Data):
                    body += event.data
                else:
                    raise HarnessError(f"{octets[:80]!r} was made as a complete request, and is none")
        except h11.RemoteProtocolError as error:
            raise HarnessError(f"{octets[:80]!r} was made as a valid request, and is none: {error}") from error
        if request is None:
            raise AssertionError("unreachable: h11 has no content without a request")
        yield request, bytes(body)
        octets = server.trailing_data[0]
