"""Base classes of recorders: of requests over connections, and of other observations.

Every client calls the recorder of its connection settings, which copies of these settings share: those of concurrent
clients, of the stop at the end, and of raw sockets. So nothing that is sent is hidden from the history.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from conformance.transport.exchange import NoAnswer, Request, Response


class Heard(StrEnum):
    """Whether the checkers judge a response."""

    ALWAYS = "always"
    #: several clients send requests at once: an overload response is no fault
    UNLESS_BUSY = "unless busy"
    #: a login, a sign of life, or commands that keep a device moving during a measurement
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class Passage:
    """One attempt to send a request over a connection, with its outcome.

    Attributes:
        request: the request, with variables in place of credentials.
        connection: the connection's number in the run, from 1; 0 where a library keeps the connections.
        place: the request's place on it, from 1.
        attempt: 1, or 2 where the first connection had been closed by the server.
        sent_s: when sending began, s on the monotonic clock.
        first_s: when the first octet came back; 0 if none came.
        ended_s: when the last octet came, or was waited for no longer.
        within_s: the deadline for a response of usual size, s after sending; 0 if none was waited for.
        response: what came back: a response, the octets of a raw socket as they came, or None.
        problem: what happened instead of a response, in words, or empty.
        kind: the same as an enum value.
        whole: whether all of the request was sent.
        heard: whether what came back is judged like every response.
    """

    request: Request
    connection: int
    place: int
    attempt: int
    sent_s: float
    first_s: float
    ended_s: float
    within_s: float
    response: Response | bytes | None
    problem: str = ""
    kind: NoAnswer | None = None
    whole: bool = True
    heard: Heard = Heard.ALWAYS


class EyeState(StrEnum):
    """Whether an observer that sends no requests sees the device."""

    OPENED = "opened"
    LOST = "lost"
    CLOSED = "closed"


class Recorder:
    """Base class of recorders of a run. Does nothing. Any thread may call its methods, which return at once."""

    def record(self, passage: Passage) -> int:  # noqa: ARG002 - for those that record
        """Record an attempt to send a request; return its number in the run, from 1."""
        return 0

    def withdraw(self, number: int) -> None:
        """Record that a response was none of the device's to this request: a gateway's, or the challenge before it."""

    def saw(self, eye: str, at_s: float, values: Sequence[float | int | str]) -> None:
        """Record an eye's observation and its time by the machine's monotonic clock, s."""

    def eye(self, eye: str, state: EyeState) -> None:
        """Record that an eye sees from now on, or does no longer."""
