"""Valid requests over a plain socket: each is read back from its octets before it is sent.

h11 stands for the robot's server: octets that it does not read as valid requests are never sent as such.
"""

from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import h11

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.transport import raw
from conformance.transport.exchange import Attempt
from conformance.verdict.evidence import HarnessError


def ask(api: RestInterface, method: str, path: str, *fields: str, body: bytes = b"", **how: Any) -> Attempt:
    """Send one valid request over a socket of its own, and return what became of it.

    Args:
        api: the robot's REST interface.
        method: as on the wire.
        path: below the base URL.
        fields: whole lines, without line ends.
        body: as on the wire, in chunks if the fields say so.
        how: deadline and pauses, as raw.talk() has them.

    Raises:
        HarnessError: the request is not valid by the contract.
        NoAnswerError: no connection could be opened.
    """
    return ask_octets(api, raw.head(api.client, method, path, *fields) + body, method, **how)


def ask_octets(api: RestInterface, octets: bytes, method: str = "GET", **how: Any) -> Attempt:
    """Send the octets of one valid request, and return what became of it; as ask()."""
    return raw.read_one(api.client, octets, talk(api, octets, answers=1, **how), method)[0]


def talk(api: RestInterface, octets: bytes, *, answers: int = 0, refused: bool = False, **how: Any) -> raw.RawAnswer:
    """Send octets that hold valid requests, and return what comes; as raw.talk().

    Args:
        api: the robot's REST interface.
        octets: what to send.
        answers: stop after so many complete responses to GET.
        refused: whether the requests may break the contract; they are complete all the same.
        how: deadline and pauses, as raw.talk() has them.

    Raises:
        HarnessError: they do not.
        NoAnswerError: there is no connection.
    """
    for request, body in _requests(octets):
        method, target = request.method.decode(), request.target.decode()
        if not target.startswith("/"):
            parts = urlsplit(target)
            target = parts.path + (f"?{parts.query}" if parts.query else "")
        fields = dict(request.headers)
        media_type = fields.get(b"content-type", b"").decode().split(";", 1)[0].strip().lower()
        below = target.removeprefix(api.client.prefix)
        if not refused:
            require_valid(api.run.contract, method, below, media_type, body)
    return raw.talk(api.client, octets, answers=answers, **how)


def _requests(octets: bytes) -> Iterator[tuple[h11.Request, bytes]]:
    """Yield each request in some octets, with its content.

    Raises:
        HarnessError: they are no requests, or not whole.
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
