"""Clients that vanish, and clients that never come to an end."""

from contextlib import closing
from typing import Final

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.observe.polling import poll_for
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, POSE, STILL, VELOCITY, Robot, Velocity
from conformance.packs.table1.robot.standstill import Standstill
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Unanswered
from conformance.transport.incomplete_request import PartialRequest
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
_VANISHED: Final = "safety/client-vanished"
_EXPECTED: Final = "rest, and an answer, after clients vanished in mid-request"
# After each; all are watched for the settle time in the end, s.
_WATCH_S: Final = 0.06
# For so long a robot has time to read what has come before the connection breaks, s.
_READ_S: Final = 0.03
# The usual time may be a tenth of a millisecond; a scheduler's turn on a busy machine is no failure, s.
_USUAL_S: Final = 1.0
# Nor is an answer that the network held up: who waits for the others' requests to end does not answer the third one.
_TRIES: Final = 3


@pytest.mark.phase("standstill")
@pytest.mark.motion
@pytest.mark.requirement(_VANISHED)
def test_client_vanished(api: RestInterface, robot: Robot, standstill: Standstill) -> None:
    """A velocity of which not all octets came is none, also where those that came would make one."""
    moved = _vanish(api, Drive(robot))
    standstill.expect(_VANISHED, _EXPECTED, lambda: _vanish_again(api, robot), seconds=robot.limits.settle_s)
    if moved:
        # By this, or by what was tried before: each is tried again by itself.
        standstill.judge()


def _vanish_again(api: RestInterface, robot: Robot) -> None:
    """The same, and a watch of what follows."""
    drive = Drive(robot)
    expected = _vanish(api, drive)
    if not expected:
        drive.keep(robot.limits.settle_s)
    # An answer to whoever comes next shows that the robot is still there.
    still, found = drive.sees(STILL, 2)
    exchange = drive.trace.turns[-1].velocity_exchange
    stays = bool(still) and not expected
    robot.judge.check(_VANISHED, stays, exchange, expected or _EXPECTED, found=f"the velocity ({found})", cause="moves")
    if not stays:
        bring_to_rest(api)


def _vanish(api: RestInterface, drive: Drive) -> str:
    """Begin requests, and let the client vanish before they end; say what was to leave the robot at rest and did not.

    Empty where it stays at rest.
    """
    robot, rest = drive.robot, api.client
    fast = Velocity(linear_x=0.3 * robot.limits.linear_m_s, angular_z=0.5 * robot.limits.angular_rad_s)
    body, linear = body_of(fast.twist), body_of(fast.linear)
    for path, sent, promised, reset in (
        (VELOCITY, body[: len(body) // 2], len(body), True),
        (VELOCITY, body, len(body) + 10, True),
        (VELOCITY, body, len(body) + 10, False),
        (VELOCITY, body, None, False),
        (LINEAR, linear, len(linear) + 10, False),
        (LINEAR, linear, None, True),
    ):
        partial = PartialRequest(rest, "PUT", path, sent=sent, promised=promised)
        robot.clock.sleep(_READ_S)
        partial.vanish(reset=reset)
        for _ in poll_for(robot.clock, 0.0, _WATCH_S * robot.watchfulness**2):
            if drive.sees(STILL, 2)[0] is False:
                return f"rest after {partial.request.method} {path} of which not all octets were sent"
    return ""


@pytest.mark.phase("reading")
@pytest.mark.requirement("safety/half-request")
def test_half_requests(robot: Robot, rest: HttpClient, judge: Judge) -> None:
    """While three clients do not come to an end of their requests, others are answered in the usual time."""
    patience_s = max(_USUAL_S, 20 * robot.usual_s)
    judge.at_risk = ("safety/half-request",)
    with (
        PartialRequest(rest, "GET", POSE, head_only=20),
        PartialRequest(rest, "GET", POSE, head_only=-2),
        PartialRequest(rest, "OPTIONS", GOAL_PATH, sent=b"{", promised=100),
    ):
        expected = f"an answer within {patience_s:g} s while three other requests are incomplete"
        for path in (POSE, VELOCITY, POSE):
            attempt = _sent(rest, path, patience_s)
            answered = isinstance(attempt, Exchange)
            if not judge.check("safety/half-request", answered, attempt, expected):
                return


def _sent(client: HttpClient, path: str, patience_s: float) -> Attempt:
    """Return what became of a GET, which is sent again when its response does not come in time."""
    attempt = _ask_once(client, path, patience_s)
    for _ in range(_TRIES - 1):
        if isinstance(attempt, Unanswered) and attempt.kind is NoAnswer.TIMEOUT:
            attempt = _ask_once(client, path, patience_s)
    return attempt


def _ask_once(client: HttpClient, path: str, patience_s: float) -> Attempt:
    # A client of its own: what hangs here, for once, need not hang later. A connection of its own: one that is open
    # already might be served by a thread of its own.
    with closing(HttpClient(client.base_url, client.connection)) as other:
        try:
            return other.send("GET", path, fresh=True, timeout_s=patience_s)
        except NoAnswerError as none:
            return none.unanswered
