"""The events of a history, each written as one JSON object whose key ``event`` names its type.

All times are seconds since the run began, by its monotonic clock. What a later version adds has a default, so that
older histories are still read: what they lack was not seen.
"""

import hashlib
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final, Self

import msgspec

from conformance.commandline.given_files import read_octets
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Request, Response, Unanswered
from conformance.transport.passage import EyeState, Heard, Passage

#: Version of the file format.
VERSION: Final = 1
# Bytes of a body that are kept; a longer body has only hash and length.
_MOST_KEPT: Final = 1 << 20


class Octets(msgspec.Struct, frozen=True, omit_defaults=True):
    """A body, or the bytes on a socket: as text if they are UTF-8, else in base64, else by their hash.

    Attributes:
        text: the octets as UTF-8.
        base64: the octets where they are not UTF-8.
        sha256: their hash in hexadecimal digits, if they are more than 1 MiB.
        length: how many they are, if only the hash is kept.
    """

    text: str = ""
    base64: bytes = b""
    sha256: str = ""
    length: int = 0

    @classmethod
    def of(cls, octets: bytes) -> Self:
        """Return how octets are written."""
        if len(octets) > _MOST_KEPT:
            return cls(sha256=hashlib.sha256(octets).hexdigest(), length=len(octets))
        try:
            return cls(text=octets.decode())
        except UnicodeDecodeError:
            return cls(base64=octets)

    @property
    def content(self) -> bytes | None:
        """The octets, or None if only their hash is kept."""
        return None if self.sha256 else self.base64 or self.text.encode()


class Came(msgspec.Struct, frozen=True, omit_defaults=True):
    """A response: status, version and header fields as received, and the body after transfer decoding.

    Attributes:
        status, version, headers, body: of the response.
        cut: why the body was not read to its end, or empty.
    """

    status: int
    headers: tuple[tuple[str, str], ...] = ()
    body: Octets = Octets()
    version: str = "HTTP/1.1"
    cut: str = ""


class Sent(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="event", tag="sent"):
    """One attempt to send a request over a connection, and the response or its absence.

    Attributes:
        id: number of the event, from 1.
        span: what the suite was doing, as in Span.
        client: the client that sent it, as the suite's threads are called.
        connection, place, attempt: as in Passage.
        sent_s, first_s, ended_s: when sending began, the first octet came (0: none did), and the last one.
        within_s: the deadline; 0 if no response was waited for.
        method, url, query, headers, body: of the request, with variables in place of credentials.
        raw: the bytes on the socket, if they were written by hand.
        whole: whether all of the request was sent.
        came: the response; None if there was none, or it was not parsed.
        octets: what a raw socket received, as it came.
        problem, kind: what happened instead of a response.
        heard: whether the response is judged by the rules for every response.
    """

    id: int
    span: str
    client: str
    connection: int
    place: int
    sent_s: float
    ended_s: float
    method: str
    url: str
    first_s: float = 0.0
    within_s: float = 0.0
    attempt: int = 1
    query: str = ""
    headers: tuple[tuple[str, str], ...] = ()
    body: Octets = Octets()
    raw: Octets | None = None
    whole: bool = True
    came: Came | None = None
    octets: Octets | None = None
    problem: str = ""
    kind: NoAnswer | None = None
    heard: Heard = Heard.ALWAYS

    @classmethod
    def of(cls, passage: Passage, number: int, span: str, client: str, began_s: float) -> Self:
        """Return the event of a passage."""
        request, response = passage.request, passage.response

        def since(moment_s: float) -> float:
            return round(moment_s - began_s, 6) if moment_s else 0.0

        return cls(
            number,
            span,
            client,
            passage.connection,
            passage.place,
            since(passage.sent_s),
            since(passage.ended_s),
            request.method,
            request.url,
            since(passage.first_s),
            passage.within_s,
            passage.attempt,
            request.query,
            request.headers,
            Octets.of(request.body),
            None if request.raw is None else Octets.of(request.raw),
            passage.whole,
            _came(response) if isinstance(response, Response) else None,
            Octets.of(response) if isinstance(response, bytes) else None,
            passage.problem,
            passage.kind,
            passage.heard,
        )

    @property
    def request(self) -> Request | None:
        """The request, or None if its body was too long to be kept."""
        body, raw = self.body.content, self.raw.content if self.raw else None
        if body is None or (self.raw and raw is None):
            return None
        return Request(self.method, self.url, self.headers, body, raw, self.query)

    @property
    def outcome(self) -> Attempt | None:
        """Request and response as checks have them; None if the history does not have them whole."""
        request, came = self.request, self.came
        if request is None or self.octets is not None:
            return None
        if came is None:
            return Unanswered(request, self.problem, self.kind or NoAnswer.CLOSED)
        body = came.body.content
        if body is None:
            return None
        elapsed_ms = 1000 * (self.ended_s - self.sent_s)
        return Exchange(
            request, Response(came.status, came.headers, body, elapsed_ms, came.version, self.ended_s, came.cut)
        )


def _came(response: Response) -> Came:
    return Came(response.status, response.headers, Octets.of(response.octets), response.http_version, response.cut)


class Began(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="event", tag="began"):
    """The first event: version of the format, suite, and time when the run began (RFC 3339)."""

    version: int
    suite: str
    started: str


class Span(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="event", tag="span"):
    """From here on, the suite did this: the name of a check, or empty between checks."""

    at_s: float
    name: str


class Withdrawn(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="event", tag="withdrawn"):
    """The response in the event ``id`` was not the device's to that request, and is not judged."""

    id: int


class Seen(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="event", tag="seen"):
    """An observation beside the requests, such as a ROS message, with the time at which it was made."""

    at_s: float
    eye: str
    values: tuple[float | int | str, ...]


class Eye(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="event", tag="eye"):
    """From here on, an eye sees, or does no longer: that something is missing counts only while it sees."""

    at_s: float
    eye: str
    state: EyeState


class Ended(msgspec.Struct, frozen=True, omit_defaults=True, tag_field="event", tag="ended"):
    """The last event of a history that is whole.

    Attributes:
        at_s: when it was written.
        events: how many exchanges it has.
        problem: why not all of them are in it, or empty.
    """

    at_s: float
    events: int
    problem: str = ""


Event = Began | Sent | Withdrawn | Span | Seen | Eye | Ended


_MOST: Final = 512 << 20
_MOST_UNPACKED: Final = 4 << 30  # bytes of all events, unpacked
_MOST_LINE: Final = 64 << 20  # bytes of one event with 1 MiB of request and response, escaped
_PIECE: Final = 1 << 20


class HistoryError(ValueError):
    """Raised for a file that is no history; the message explains why."""


def read_history(path: Path) -> Iterator[Event]:
    """Yield the events of a history, the first of which is Began; a history that is cut short ends earlier.

    Raises:
        HistoryError: it cannot be read, is of a later version, or an event is not well made.
    """
    decoder = msgspec.json.Decoder(Event)
    try:
        for number, line in enumerate(_lines(read_octets(path, _MOST)), 1):
            yield _check(decoder.decode(line), number)
    except (OSError, ValueError, RecursionError) as error:
        raise HistoryError(f"{path} cannot be read as a history: {error}") from error


def _check(event: Event, number: int) -> Event:
    if (number == 1) != isinstance(event, Began):
        raise ValueError(f"line {number}: a history has one event `began`, its first")
    if isinstance(event, Began) and event.version > VERSION:
        raise ValueError(f"it is of version {event.version}, and this suite knows {VERSION}")
    return event


def _lines(octets: bytes) -> Iterator[bytes]:
    """Yield the whole lines of gzip data that may be cut short.

    Raises:
        ValueError: it is no gzip data, or holds too much.
    """
    opened, rest, unpacked = zlib.decompressobj(31), b"", 0
    while not opened.eof:
        try:
            piece = opened.decompress(octets, _PIECE)
        except zlib.error as error:
            raise ValueError(f"no gzip data: {error}") from error
        octets = opened.unconsumed_tail
        if not piece:
            return  # the process that wrote the file was killed
        unpacked += len(piece)
        *lines, rest = (rest + piece).split(b"\n")
        if unpacked > _MOST_UNPACKED or len(rest) > _MOST_LINE:
            raise ValueError("it holds more than a run writes")
        yield from lines
