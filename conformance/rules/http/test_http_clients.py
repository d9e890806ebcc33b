"""Several clients at once, and several requests on one connection: an answer belongs to its request."""

import itertools

import pytest

from conformance.api.rest import by_hand
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.questions import Question, misplaced, questions, rounds
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Unanswered
from conformance.transport.parallel import MOST_CLIENTS, is_busy, send_together
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
# A robot that is wrong one time in fifty is asked often enough to be wrong several times.
_ROUNDS = 40
_IN_A_ROW = 6


@pytest.fixture(scope="module")
def asked() -> list[Question]:
    """What the robot is asked: found by the first check that asks, and shared with the others."""
    return []


def _questions(api: RestInterface, known: list[Question]) -> list[Question]:
    """What is asked; ends the check that asks, as one that cannot be judged, where the robot answers nothing of it."""
    if not known:
        known += questions(api, api.device.questions(api))
    if not known:
        pytest.skip("no resource gives an answer that can be told from another's")
    return known


@pytest.mark.requirement("http/concurrent-answers")
def test_answers_do_not_cross(api: RestInterface, judge: Judge, asked: list[Question]) -> None:
    """Eight clients ask different things at one moment, again and again; each gets the answer to its own question."""
    turns = rounds(_questions(api, asked), MOST_CLIENTS, api.run.effort.cases(_ROUNDS))
    attempts = send_together([[question.outgoing(api) for question in turn] for turn in turns])
    for question, attempt in zip(itertools.chain(*turns), itertools.chain(*attempts), strict=True):
        if isinstance(attempt, Unanswered) or is_busy(attempt):
            continue  # one that serves few at a time is not blamed
        stranger = misplaced(api, question, attempt.response)
        judge.check(
            "http/concurrent-answers",
            not stranger,
            attempt,
            "the answer to this request, while others are answered",
            found=stranger,
            cause="another's answer",
        )


@pytest.mark.requirement("http/pipelining")
def test_answers_come_in_order(api: RestInterface, rest: HttpClient, judge: Judge, asked: list[Question]) -> None:
    """Requests that are sent before the answers come are answered in their order (RFC 9112 9.3.2)."""
    for turn in rounds(_questions(api, asked), _IN_A_ROW, api.run.effort.cases(_IN_A_ROW)):
        heads = [raw.head(rest, "GET", one.path, f"Accept: {one.accept}") for one in turn]
        octets = b"".join(heads)
        came = by_hand.talk(api, octets, answers=len(turn), refused=True)
        for question in turn:
            attempt, behind = raw.read_one(rest, octets, came, "GET")
            if isinstance(attempt, Unanswered):
                # A robot may close after any answer; of what is no HTTP, others speak.
                if not came.octets and not came.closed:
                    _judge_forgotten(api, judge, octets, attempt)
                    return
                break
            stranger = misplaced(api, question, attempt.response)
            judge.check(
                "http/pipelining",
                not stranger,
                attempt,
                f"the answers in the order of the requests, here to {question.path}",
                found=stranger,
                cause="another order",
            )
            came = raw.rest_of(came, behind)


def _judge_forgotten(api: RestInterface, judge: Judge, octets: bytes, attempt: Unanswered) -> None:
    """Judge a connection that stays open without the answers to come: not by one, which may have been held up."""
    again = by_hand.talk(api, octets, answers=_IN_A_ROW, refused=True)
    count = raw.answers_in(again.octets, _IN_A_ROW)
    judge.check(
        "http/pipelining",
        again.closed or count == _IN_A_ROW,
        attempt,
        f"{_IN_A_ROW} answers to as many requests, or a connection that is closed",
        found=f"{count} answers, and the connection stays open",
        cause="forgotten",
    )
