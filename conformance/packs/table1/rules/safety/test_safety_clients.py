"""Clients that never complete a request."""

from contextlib import closing
from typing import Final

import pytest

from conformance.packs.table1.robot.robot import GOAL_PATH, POSE, VELOCITY, Robot
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Unanswered
from conformance.transport.raw import PartialRequest
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# Least usual response time to assume, s: scheduling on a busy machine is no failure.
_USUAL_S: Final = 1.0
# Tries: a network may delay one response, but a robot that waits for other requests never responds to the third.
_TRIES: Final = 3


@pytest.mark.phase("reading")
@pytest.mark.requirement("safety/half-request")
def test_half_requests(robot: Robot, rest: HttpClient, judge: Judge) -> None:
    """Send other requests while three requests are incomplete: the robot must respond within the usual time."""
    patience_s = max(_USUAL_S, 20 * robot.usual_s)
    judge.at_risk = ("safety/half-request",)
    with (
        PartialRequest(rest, "GET", POSE, head_only=20),
        PartialRequest(rest, "GET", POSE, head_only=-2),
        PartialRequest(rest, "OPTIONS", GOAL_PATH, sent=b"{", promised=100),
    ):
        expected = f"a response within {patience_s:g} s while three other requests are incomplete"
        for path in (POSE, VELOCITY, POSE):
            attempt = _send(rest, path, patience_s)
            answered = isinstance(attempt, Exchange)
            if not judge.check("safety/half-request", answered, attempt, expected):
                return


def _send(client: HttpClient, path: str, patience_s: float) -> Attempt:
    """Send a GET, again if its response does not come in time, and return the last attempt."""
    attempt = _send_once(client, path, patience_s)
    for _ in range(_TRIES - 1):
        if isinstance(attempt, Unanswered) and attempt.kind is NoAnswer.TIMEOUT:
            attempt = _send_once(client, path, patience_s)
    return attempt


def _send_once(client: HttpClient, path: str, patience_s: float) -> Attempt:
    # A new client, because a hang here says nothing about later requests. A new connection, because an open one may be
    # served by its own thread.
    with closing(HttpClient(client.base_url, client.connection)) as other:
        try:
            return other.send("GET", path, fresh=True, timeout_s=patience_s)
        except NoAnswerError as none:
            return none.unanswered
