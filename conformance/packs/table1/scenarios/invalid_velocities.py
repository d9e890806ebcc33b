"""Requests with an invalid velocity, which would move the robot if it accepted them."""

from functools import partial
from http import HTTPStatus
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.invalid_bodies import invalid_bodies, put_body
from conformance.packs.table1.robot.robot import LINEAR, VELOCITY, Robot
from conformance.packs.table1.robot.standstill import Standstill, glance_rest
from conformance.packs.table1.robot.standstill_trace import rest
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

_AFTER: Final = "invalid velocities"


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def invalid_velocities(api: RestInterface, robot: Robot, standstill: Standstill) -> tuple[Case, ...]:
    """Send invalid velocities, at rest."""
    rests: list[Case] = []
    with partial_trace(lambda: tuple(rests)):
        _send(api, robot, rests)
    # A robot that accepts the last request after all would move within the settle time.
    repeat = partial(_send, api, robot, [])
    standstill.attempted("strict-input/velocity-refused", _AFTER, repeat, seconds=robot.limits.settle_s)
    return tuple(rests)


def _send(api: RestInterface, robot: Robot, rests: list[Case]) -> list[Case]:
    """Send invalid velocities, append a reading after each to ``rests``, and return them."""
    fast = robot.share_of_limits(0.4, 0.4)
    sent: list[tuple[str, Exchange]] = []
    for path, valid, number in ((VELOCITY, fast.twist, "linear.x"), (LINEAR, fast.linear, "x")):
        for what, media_type, body in api.run.effort.alternatives(invalid_bodies(api, path, valid, number), 8):
            sent.append((f"PUT {path} with {what}", put_body(robot, path, media_type, body)))
            rests.append(_read(robot, sent))
            if not rests[-1].holds:
                bring_to_rest(api)
                sent.clear()
    return rests


def _read(robot: Robot, sent: list[tuple[str, Exchange]]) -> Case:
    """Read the robot, once or if it moves several times; the last request that it did not reject is the cause."""
    accepted = [one for one in sent if one[1].response.status < HTTPStatus.BAD_REQUEST]
    what, exchange = (accepted or sent)[-1]
    return rest(what, exchange, glance_rest(robot, what).observed, what)
