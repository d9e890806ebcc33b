"""Many reads in a row on one connection: each gets a response, and the checkers judge each.

One series serves several requirements. Servers used to allow a hundred requests on one connection, and a failure in
fifty is noticed in twice as many.
"""

import itertools
import math
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from http import HTTPStatus

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.scenarios.scenario import NoOccasionError
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError, Unanswered
from conformance.transport.parallel import is_busy
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_AVAILABLE, _MANY = "http/available", "http/many-requests"
_IN_ALL = 120  # reads on one connection
_EACH = 60  # reads of each resource at standard effort
# After this many dropped requests, the robot is at fault; a single one may meet the end of an idle connection.
_DROPS = 3
_FIRST_S = 3.0  # time for reads without a pause, s
# If some of them fail, the robot is read at the rate that the requirement states: _READS reads, one each _EVERY_S, s.
_READS, _EVERY_S = 100, 0.1
# A client that gets 429 or 503 reads _SLOW_READS times, once each _SLOW_S, s.
_SLOW_READS, _SLOW_S = 10, 1.0
_LONGEST_WAIT_S = 10.0


@dataclass
class _Reads:
    """The outcomes of reads at one rate, in order.

    Attributes:
        rate: the rate, in words.
        attempts: the reads with their responses.
        usual: the status that each read of a series would have got at first, or on a connection of its own.
        dropped: how many requests of the series had been dropped by then.
    """

    rate: str
    attempts: list[Attempt] = field(default_factory=list)
    usual: list[int] = field(default_factory=list)
    dropped: list[int] = field(default_factory=list)

    @property
    def failed_reads(self) -> list[Attempt]:
        """The reads without an answer: a server error, too many requests, or no response."""
        return [
            exchange
            for exchange in self.attempts
            if is_busy(exchange)
            or (isinstance(exchange, Exchange) and exchange.response.status >= HTTPStatus.INTERNAL_SERVER_ERROR)
        ]

    @property
    def put_off(self) -> list[Exchange]:
        """The lost reads that the robot deferred with a Retry-After."""
        return [
            exchange
            for exchange in self.failed_reads
            if isinstance(exchange, Exchange) and exchange.response.put_off_s is not None
        ]

    @property
    def fine(self) -> bool:
        """Whether at least 99 % were answered; a single lost read is no share."""
        return len(self.failed_reads) <= max(1, len(self.attempts) // 100)

    def note(self, attempt: Attempt, usual: int, dropped: int) -> None:
        """Add one read of a series."""
        self.attempts.append(attempt)
        self.usual.append(usual)
        self.dropped.append(dropped)


@pytest.fixture(scope="session")
def series() -> _Reads:
    """Return the reads on one connection, which the first check that needs them sends."""
    return _Reads("as fast as the robot answers")


@pytest.mark.requirement(
    _MANY,
    "http/declared-status",
    "http/declared-body",
    "http/content-type",
    "http/date",
    "http/date-format",
    "http/etag-format",
    "http/last-modified",
    "http/field-once",
    "http/framing",
    "http/json-finite",
    "http/json-encoding",
    "http/json-unique-names",
)
def test_reads_on_one_connection(api: RestInterface, judge: Judge, series: _Reads) -> None:
    """Send many reads on one connection: each gets the status that it gets on a connection of its own.

    The checkers judge every response. The robot may close a connection at any time (RFC 9112 9.5), and the client then
    sends the request again on a new one. A robot that does so again and again on a busy connection drops requests.
    """
    judge.at_risk = (_MANY,)
    _send(api, series)
    for number, (attempt, usual, dropped) in enumerate(zip(series.attempts, series.usual, series.dropped, strict=True)):
        if isinstance(attempt, Unanswered):
            raise NoAnswerError(attempt)
        expect(judge, _MANY, attempt).status(usual, when=f"it is request {number + 1} on one connection")
        expect(judge, _MANY, attempt).that(
            dropped < _DROPS,
            f"a response to each of {number + 1} requests that follow each other at once",
            f"a connection that the server closed {dropped} times without a response to a request on it",
            cause="dropped",
        )


def _send(api: RestInterface, series: _Reads) -> None:
    """Send the series, if no check has sent it yet, until a request is not answered or too many were dropped."""
    if series.attempts:
        return
    calls, connection = reads(api), api.client.connection
    if not calls:
        raise NoOccasionError("no operation that only reads may be called")
    usual: dict[str, int] = {}
    resent = connection.resent
    with closing(HttpClient(api.client.base_url, connection)) as client:
        for turn, call in enumerate(_turns(api, calls)):
            accept = (("Accept", "application/json"),) if turn % 2 else ()
            try:
                exchange = client.send("GET", call.path, headers=accept)
            except NoAnswerError as none:
                series.note(none.unanswered, 0, connection.resent - resent)
                return
            if exchange.response.status != usual.setdefault(call.path, exchange.response.status):
                # The robot's state may have changed (a resource is gone, the load is high): that is no fault here.
                usual[call.path] = client.send("GET", call.path, fresh=True).response.status
            series.note(exchange, usual[call.path], connection.resent - resent)
            if series.dropped[-1] >= _DROPS:
                return


def _turns(api: RestInterface, calls: Sequence[Call]) -> list[Call]:
    """Return the reads in rounds of all operations; each round begins with another operation.

    So a robot that fails with every n-th response does not always fail with the same operation.
    """
    effort = api.run.effort
    rounds = effort.cases(_EACH)
    if not effort.slow:
        rounds = max(rounds, math.ceil(_IN_ALL / max(1, len(calls))))
    return [call for turn in range(rounds) for call in (*calls[turn % len(calls) :], *calls[: turn % len(calls)])]


@pytest.mark.requirement(_AVAILABLE)
def test_availability(api: RestInterface, judge: Judge, series: _Reads) -> None:
    """Judge the series of reads; if some failed, read again: ten times, then once a second."""
    calls = [call for call in reads(api) if call.send(api).response.status < HTTPStatus.INTERNAL_SERVER_ERROR]
    if not calls:
        judge.note(_AVAILABLE, "no resource could be read")
        return
    _send(api, series)
    seen = series
    if len(seen.attempts) < (1 if api.run.effort.slow else _READS):
        # The series has ended early.
        seen = _read(api, calls, series.rate, _READS, 0.0, _FIRST_S)
    if not seen.fine:
        _wait(seen)
        seen = _read(api, calls, "10 reads a second", _READS, _EVERY_S, _READS * _EVERY_S)
    # A robot may set its clients a rate, but not one below a read a second.
    if not seen.fine and len(seen.put_off) == len(seen.failed_reads):
        _wait(seen)
        seen = _read(api, calls, "1 read a second", _SLOW_READS, _SLOW_S, _SLOW_READS * _SLOW_S)
    shown = (seen.failed_reads or seen.attempts)[-1]
    expect(judge, _AVAILABLE, shown).that(
        seen.fine,
        f"at least 99 % of the reads answered ({seen.rate})",
        f"{len(seen.failed_reads)} of {len(seen.attempts)} reads without an answer, the last one with {shown.came}",
        cause=shown.came,
    )


def _read(api: RestInterface, calls: Sequence[Call], rate: str, count: int, every_s: float, most_s: float) -> _Reads:
    seen = _Reads(rate)
    begun = time.monotonic()
    for number, call in enumerate(itertools.islice(itertools.cycle(calls), count)):
        time.sleep(max(0.0, begun + number * every_s - time.monotonic()))
        try:
            seen.attempts.append(api.client.send("GET", call.path))
        except NoAnswerError as none:
            seen.attempts.append(none.unanswered)
        if time.monotonic() > begun + most_s:
            break
    return seen


def _wait(seen: _Reads) -> None:
    """Wait as long as the robot's Retry-After demands."""
    time.sleep(
        min(_LONGEST_WAIT_S, max((exchange.response.put_off_s or 0.0 for exchange in seen.put_off), default=0.0))
    )
