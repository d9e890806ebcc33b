"""Availability: a robot answers nearly every read at a rate that each dashboard has."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from http import HTTPStatus

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError
from conformance.transport.parallel import is_busy
from conformance.transport.put_off import put_off_s
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_ID = "http/available"
# The first look is as fast as the robot answers and takes no longer than this, s. Only a robot that does not answer all
# of it is looked at again, at the rate that the requirement names.
_FIRST_S = 3.0
_READS, _EVERY_S = 100, 0.1
# A client that was told to slow down reads at this interval, s, so often.
_SLOW_READS, _SLOW_S = 10, 1.0
_LONGEST_WAIT_S = 10.0


@dataclass(frozen=True)
class _Reads:
    """What became of reads at one rate, in order."""

    rate: str
    attempts: Sequence[Attempt]

    @property
    def lost(self) -> list[Attempt]:
        """The reads without an answer: a server error, too many requests, or no response."""
        return [
            one
            for one in self.attempts
            if is_busy(one) or (isinstance(one, Exchange) and one.response.status >= HTTPStatus.INTERNAL_SERVER_ERROR)
        ]

    @property
    def put_off(self) -> list[Attempt]:
        """Those of them that the robot put off, and said for how long."""
        return [one for one in self.lost if put_off_s(one) is not None]

    @property
    def fine(self) -> bool:
        """Whether at least 99 % were answered; a single lost read is no share."""
        return len(self.lost) <= max(1, len(self.attempts) // 100)


@pytest.mark.requirement(_ID)
def test_availability(api: RestInterface, judge: Judge) -> None:
    """Read all resources in turn: as fast as the robot answers, and, if it loses reads, ten times and once a second."""
    calls = [call for call in reads(api) if call.send(api).response.status < HTTPStatus.INTERNAL_SERVER_ERROR]
    if not calls:
        judge.note(_ID, "no resource could be read")
        return
    seen = _read(api, calls, "as fast as the robot answers", _READS, 0.0, _FIRST_S)
    if not seen.fine:
        _wait(seen)
        seen = _read(api, calls, "10 reads a second", _READS, _EVERY_S, _READS * _EVERY_S)
    # A robot may set its clients a rate, but not one below a read a second.
    if not seen.fine and len(seen.put_off) == len(seen.lost):
        _wait(seen)
        seen = _read(api, calls, "1 read a second", _SLOW_READS, _SLOW_S, _SLOW_READS * _SLOW_S)
    shown = (seen.lost or seen.attempts)[-1]
    expect(judge, _ID, shown).that(
        seen.fine,
        f"at least 99 % of the reads answered ({seen.rate})",
        f"{len(seen.lost)} of {len(seen.attempts)} reads without an answer, the last one with {shown.came}",
        cause=shown.came,
    )


def _read(api: RestInterface, calls: Sequence[Call], rate: str, count: int, every_s: float, most_s: float) -> _Reads:
    attempts: list[Attempt] = []
    begun = time.monotonic()
    for number in range(count):
        time.sleep(max(0.0, begun + number * every_s - time.monotonic()))
        call = calls[number % len(calls)]
        try:
            attempts.append(api.client.send("GET", call.path))
        except NoAnswerError as none:
            attempts.append(none.unanswered)
        if time.monotonic() > begun + most_s:
            break
    return _Reads(rate, attempts)


def _wait(seen: _Reads) -> None:
    """Wait as long as the robot asked for."""
    time.sleep(min(_LONGEST_WAIT_S, max((put_off_s(one) or 0 for one in seen.put_off), default=0)))
