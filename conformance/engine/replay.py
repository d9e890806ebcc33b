"""Sending a finding's requests again, in their order and at their pace, and saying whether it is still there."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from conformance.engine.sequence import read_request
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError, Response, Unanswered

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from conformance.transport.exchange import Attempt, Request

# A pause between two requests is kept, as what is judged may be what comes after it; never longer than this, s.
_LONGEST_PAUSE_S = 10.0
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
# What the client says by itself.
_OF_THE_CLIENT = frozenset({"host", "content-length", "connection"})


class Outcome(StrEnum):
    """What became of a finding."""

    STILL_THERE = "still there"
    GONE = "gone"
    NOT_REPLAYED = "cannot be sent again"
    UNREACHABLE = "the robot cannot be reached"


@dataclass(frozen=True)
class Replayed:
    """One finding that was sent again.

    Attributes:
        requirement: its id.
        message: what was found.
        outcome: what became of it.
        came: what came now, in a few words.
        sent: how many requests went out.
    """

    requirement: str
    message: str
    outcome: Outcome
    came: str = ""
    sent: int = 0


def findings(result: Mapping[str, Any], requirement: str | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """The findings of a result, of one requirement or of all, by its id."""
    for item in result["requirements"]:
        if requirement in {None, item["id"]}:
            yield from ((item["id"], failure) for failure in item["failures"])


def moves(result: Mapping[str, Any], failure: Mapping[str, Any]) -> bool:
    """Whether sending it again may move the robot: it writes, or calls the service that acts."""
    reading = result["target"].get("subscribers_endpoint")
    return any(
        item["method"] not in _SAFE and not (item["method"] == "POST" and item["url"] == reading)
        for item in failure.get("sequence", ())
    )


def replay(id_: str, failure: Mapping[str, Any], connection: Connection) -> Replayed:
    """Send one finding's requests again.

    Raises:
        ValueError, KeyError, TypeError: the result is not well made.
    """
    message, sequence = str(failure["message"]), failure.get("sequence") or []
    requests = [request for item in sequence if (request := read_request(item)) is not None]
    if failure["response"] is None or not requests or len(requests) < len(sequence):
        return Replayed(id_, message, Outcome.NOT_REPLAYED)
    came: list[Attempt] = []
    began = time.monotonic()
    for item, request in zip(sequence, requests, strict=True):
        due = began + float(item["at_s"])
        time.sleep(min(max(0.0, due - time.monotonic()), _LONGEST_PAUSE_S))
        attempt = send_again(request, connection)
        if isinstance(attempt, Unanswered) and attempt.kind is NoAnswer.REFUSED:
            return Replayed(id_, message, Outcome.UNREACHABLE, attempt.problem)
        came.append(attempt)
    outcome = Outcome.STILL_THERE if _same(failure["response"], came[-1]) else Outcome.GONE
    return Replayed(id_, message, outcome, came[-1].came, len(requests))


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


def _same(recorded: Mapping[str, Any], came: Attempt) -> bool:
    """Whether an answer is what was found: none, or one of the same status, media type and kind of content."""
    if not isinstance(came, Exchange):
        return recorded["status"] is None
    fields = tuple((name, str(value)) for name, value in recorded["headers"].items())
    before = Response(recorded["status"] or 0, fields, (recorded["body"] or "").encode(), 0.0)
    return is_same(before, came)


def is_same(before: Response, came: Attempt) -> bool:
    """Whether an answer has the status and the media type of another one, and content where that has some."""
    if not isinstance(came, Exchange):
        return False
    now = came.response
    same_kind = (before.status, before.media_type) == (now.status, now.media_type)
    return same_kind and bool(before.body) == bool(now.body)
