"""Sending a recorded request again as it was, and comparing the kind of what comes."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, NoAnswerError, Response

if TYPE_CHECKING:
    from conformance.transport.exchange import Attempt, Request

# What the client says by itself.
_OF_THE_CLIENT = frozenset({"host", "content-length", "connection"})


def send_again(request: Request, connection: Connection) -> Attempt:
    """Send a request as it was sent, over a connection of its own, and take what comes."""
    where = urlsplit(request.url)
    with closing(HttpClient(f"{where.scheme}://{where.netloc}", connection)) as client:
        try:
            if request.raw is not None:
                octets = request.raw.replace(b"$ROAAS_TOKEN", (connection.token or "").encode("latin-1"))
                answer = raw.talk(client, octets, answers=1)
                return raw.read_one(client, octets, answer, request.method)[0]
            fields = [pair for pair in request.headers if pair[0].lower() not in _OF_THE_CLIENT]
            fields = [pair for pair in fields if pair != ("Authorization", "Bearer $ROAAS_TOKEN")]
            authorized = len(fields) < sum(name.lower() not in _OF_THE_CLIENT for name, _ in request.headers)
            if not any(name.lower() == "accept" for name, _ in fields):
                fields.append(("Accept", ""))
            target = where.path + (f"?{where.query}" if where.query else "")
            return client.send(
                request.method, target, headers=fields, body=request.body, fresh=True, authorized=authorized
            )
        except NoAnswerError as none:
            return none.unanswered


def is_same(before: Response, came: Attempt) -> bool:
    """Whether an answer has the status and the media type of another one, and content where that has some."""
    if not isinstance(came, Exchange):
        return False
    now = came.response
    same_kind = (before.status, before.media_type) == (now.status, now.media_type)
    return same_kind and bool(before.body) == bool(now.body)
