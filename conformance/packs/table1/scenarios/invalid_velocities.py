"""Requests with an invalid velocity, which would move the robot if it accepted them."""

from functools import partial
from http import HTTPStatus
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.invalid_bodies import invalid_bodies, put_body
from conformance.packs.table1.robot.robot import LINEAR, STILL, VELOCITY, Robot
from conformance.packs.table1.robot.standstill import Standstill, read_rest
from conformance.packs.table1.robot.standstill_trace import Rest
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange

_AFTER: Final = "invalid velocities"


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def invalid_velocities(api: RestInterface, robot: Robot, standstill: Standstill) -> tuple[Rest, ...]:
    """Send invalid velocities, at rest."""
    rests: list[Rest] = []
    with partial_trace(lambda: tuple(rests)):
        _send(api, robot, rests)
    repeat = partial(_repeat, api, robot)
    standstill.attempted("strict-input/velocity-refused", _AFTER, repeat, seconds=robot.limits.settle_s)
    return tuple(rests)


def _repeat(api: RestInterface, robot: Robot) -> list[Rest]:
    """Send the same requests again, and watch the robot for the settle time."""
    rests: list[Rest] = []
    drive, sent = _send(api, robot, rests)
    # A robot that accepts the last request after all would move within the settle time.
    drive.keep(robot.limits.settle_s)
    return [*rests, _read(drive, sent)] if sent else rests


def _send(api: RestInterface, robot: Robot, rests: list[Rest]) -> tuple[Drive, list[tuple[str, Exchange]]]:
    """Send invalid velocities, and append a reading after each; return those since the robot was last stopped."""
    fast = robot.share_of_limits(0.4, 0.4)
    drive = Drive(robot)
    sent: list[tuple[str, Exchange]] = []
    for path, valid, number in ((VELOCITY, fast.twist, "linear.x"), (LINEAR, fast.linear, "x")):
        for what, media_type, body in api.run.effort.alternatives(invalid_bodies(api, path, valid, number), 8):
            sent.append((f"PUT {path} with {what}", put_body(robot, path, media_type, body)))
            rests.append(_read(drive, sent))
            if rests[-1].found:
                bring_to_rest(api)
                sent.clear()
    return drive, sent


def _read(drive: Drive, sent: list[tuple[str, Exchange]]) -> Rest:
    """Read the robot, once or if it moves several times; the last request that it did not reject is the cause."""
    accepted = [one for one in sent if one[1].response.status < HTTPStatus.BAD_REQUEST]
    what, exchange = (accepted or sent)[-1]
    velocity, _ = drive.robot.velocity()
    at_rest = velocity is None or drive.robot.near(velocity, STILL)
    found = "" if at_rest else read_rest(drive, what).found
    return Rest(what, exchange, found, what)
