"""Clients that vanish in the middle of a request that would move the robot."""

from functools import partial
from typing import Final

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import LINEAR, VELOCITY, Robot
from conformance.packs.table1.robot.standstill import Standstill, watch_rest
from conformance.packs.table1.robot.standstill_trace import Rest
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.incomplete_request import PartialRequest

_AFTER: Final = "clients vanished in the middle of a request"
# For so long the robot is watched after each request; after all of them, for the settle time, s.
_WATCH_S: Final = 0.06
# For so long a robot has time to read the sent part before the connection breaks, s.
_READ_S: Final = 0.03


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def vanished_clients(robot: Robot, standstill: Standstill) -> tuple[Rest, ...]:
    """Send velocities of which some bytes are missing, and close the connection, at rest."""
    rests = _vanish(Drive(robot))
    repeat = partial(_repeat, robot)
    standstill.attempted("safety/client-vanished", _AFTER, repeat, seconds=robot.limits.settle_s)
    if rests[-1].found:
        # By this attempt, or by an earlier one: each is repeated alone.
        standstill.watch()
    return rests


def _repeat(robot: Robot) -> list[Rest]:
    """Send the same requests again, and watch the robot for the settle time unless one moves it."""
    drive = Drive(robot)
    last = _vanish(drive)[-1]
    return [last if last.found else watch_rest(drive, _AFTER, robot.limits.settle_s)]


def _vanish(drive: Drive) -> tuple[Rest, ...]:
    """Begin requests and close the connection before they end; return the readings, up to the first with motion."""
    robot = drive.robot
    fast = robot.share_of_limits(0.3, 0.5)
    body, linear = body_of(fast.twist), body_of(fast.linear)
    rests: list[Rest] = []
    for path, sent, promised, reset in (
        (VELOCITY, body[: len(body) // 2], len(body), True),
        (VELOCITY, body, len(body) + 10, True),
        (VELOCITY, body, len(body) + 10, False),
        (VELOCITY, body, None, False),
        (LINEAR, linear, len(linear) + 10, False),
        (LINEAR, linear, None, True),
    ):
        request = PartialRequest(robot.rest, "PUT", path, sent=sent, promised=promised)
        robot.clock.sleep(_READ_S)
        request.vanish(reset=reset)
        after = f"PUT {path} of which some bytes were not sent"
        rests.append(watch_rest(drive, after, _WATCH_S * robot.watchfulness**2))
        if rests[-1].found:
            break
    return tuple(rests)
