"""Several clients at once, and several requests on one connection: each response belongs to its request."""

import itertools
from collections.abc import Sequence

import pytest

from conformance.api.expectation import expect
from conformance.api.rest import by_hand
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.questions import Question, mismatch_of, questions, rounds
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Unanswered
from conformance.transport.parallel import MOST_CLIENTS, crowd, is_busy, send_together
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
# Rounds: a robot that fails one time in fifty fails several times in them.
_ROUNDS = 40
_IN_A_ROW = 6
# Concurrent clients that are served at least; a robot may tell the others that it is busy.
_SERVED = 2


@pytest.fixture(scope="session")
def asked() -> list[Question]:
    """Return the list of distinguishable requests, which the first check fills for all."""
    return []


def _questions(api: RestInterface, known: list[Question]) -> list[Question]:
    """Return requests with distinguishable responses; skip the check if the robot has none."""
    if not known:
        known += questions(api, api.device.questions(api))
    if not known:
        pytest.skip("no resource gives a response that can be told from another one's")
    return known


@pytest.mark.requirement("http/concurrent-answers", "http/concurrent-served", "robustness/own-answer")
def test_answers_do_not_cross(api: RestInterface, judge: Judge, asked: list[Question]) -> None:
    """Let eight clients send different requests at one moment, again and again; each must get its own response."""
    turns = rounds(_questions(api, asked), MOST_CLIENTS, api.run.effort.cases(_ROUNDS))
    attempts = send_together([[question.outgoing(api) for question in turn] for turn in turns])
    alone = crowd(api.client, [[question.outgoing(api)[1] for question in turns[0]]], api.client.connection.timeout_s)
    if not any(map(is_busy, alone[0])):  # a limit on the rate says nothing of how many are served at once
        _judge_served(judge, attempts)
    for question, attempt in zip(itertools.chain(*turns), itertools.chain(*attempts), strict=True):
        if isinstance(attempt, Unanswered) or is_busy(attempt):
            continue  # a robot that serves few clients at a time is not blamed
        mismatch = mismatch_of(api, question, attempt.response)
        expect(judge, "robustness/own-answer", attempt).that(
            not mismatch, "the response to this request while other clients send theirs", mismatch, cause="mismatch"
        )


def _judge_served(judge: Judge, rounds_: Sequence[Sequence[Attempt]]) -> None:
    """Judge how many clients of a round are served, by the median: a busy machine may cost a robot a round."""
    served = sorted(sum(not is_busy(attempt) for attempt in attempts) for attempts in rounds_)
    median = served[len(served) // 2]
    refused = next((attempt for attempts in rounds_ for attempt in attempts if is_busy(attempt)), rounds_[0][0])
    expect(judge, "http/concurrent-served", refused).that(
        median >= _SERVED,
        f"at least {_SERVED} of {len(rounds_[0])} clients served that send a request at the same time",
        f"{median} served in half of {len(served)} rounds",
    )


@pytest.mark.requirement("web-server/pipelining")
def test_answers_come_in_order(api: RestInterface, rest: HttpClient, judge: Judge, asked: list[Question]) -> None:
    """Send several requests before the first response comes: responses keep the order (RFC 9112 9.3.2)."""
    for turn in rounds(_questions(api, asked), _IN_A_ROW, api.run.effort.cases(_IN_A_ROW)):
        heads = [raw.head(rest, "GET", one.path, f"Accept: {one.accept}") for one in turn]
        octets = b"".join(heads)
        came = by_hand.talk(api, octets, answers=len(turn), refused=True)
        for question in turn:
            attempt, behind = raw.read_one(rest, octets, came, "GET")
            if isinstance(attempt, Unanswered):
                # A robot may close after any response; broken framing is judged by http/framing.
                if not came.octets and not came.closed:
                    _judge_forgotten(api, judge, octets, attempt)
                    return
                break
            mismatch = mismatch_of(api, question, attempt.response)
            expect(judge, "web-server/pipelining", attempt).that(
                not mismatch, f"the response to GET {question.path} in its turn", mismatch, cause="another order"
            )
            came = raw.rest_of(came, behind)


def _judge_forgotten(api: RestInterface, judge: Judge, octets: bytes, attempt: Unanswered) -> None:
    """Judge a connection that stays open without a response, by trying again: the first try may have been delayed."""
    again = by_hand.talk(api, octets, answers=_IN_A_ROW, refused=True)
    count = raw.answers_in(again.octets, _IN_A_ROW)
    expect(judge, "web-server/pipelining", attempt).that(
        again.closed or count == _IN_A_ROW,
        f"{_IN_A_ROW} responses to as many requests, or a closed connection",
        f"no more responses after {count} of {_IN_A_ROW}, and the connection stays open",
        cause="forgotten",
    )
