"""Clients that vanish in the middle of a request that would move the robot."""

from functools import partial
from typing import Final, NamedTuple

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import goal_body
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, VELOCITY, Robot
from conformance.packs.table1.robot.standstill import Standstill, watch_rest
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.raw import PartialRequest
from conformance.verdict.evidence import Case

_AFTER: Final = "clients vanished in the middle of a request"
# How long the robot is watched after the requests, before the next step, s.
_WATCH_S: Final = 0.06
# Time that a robot has to read the sent part before the connection breaks, s.
_READ_S: Final = 0.03


class _Part(NamedTuple):
    """The part of a request that is sent.

    Attributes:
        path: where to.
        share: how much of the body.
        lacking: octets that Content-Length promises beyond the body; None: chunked, without the last chunk.
        reset: whether the connection ends by RST.
    """

    path: str
    share: float
    lacking: int | None
    reset: bool


_PARTS: Final = (
    _Part(VELOCITY, 0.5, 0, reset=True),
    _Part(VELOCITY, 1.0, 10, reset=True),
    _Part(VELOCITY, 1.0, 10, reset=False),
    _Part(VELOCITY, 1.0, None, reset=False),
    _Part(LINEAR, 1.0, 10, reset=False),
    _Part(LINEAR, 1.0, None, reset=True),
    _Part(GOAL_PATH, 1.0, 10, reset=False),
)
# How far away the goal is, m.
_AWAY_M: Final = 1.0


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def vanished_clients(robot: Robot, standstill: Standstill) -> tuple[Case, ...]:
    """Send velocities of which some bytes are missing, and close the connection, at rest."""
    _vanish(robot, *_PARTS)
    rest = watch_rest(Drive(robot), _AFTER, _watch_s(robot))
    standstill.attempted("safety/client-vanished", _AFTER, partial(_repeat, robot), seconds=robot.limits.settle_s)
    if not rest.holds:
        # By this attempt, or by an earlier one: each is repeated alone.
        standstill.watch()
    return (rest,)


def _repeat(robot: Robot) -> list[Case]:
    """Send the same requests again, and watch after each, until one has moved the robot."""
    for part in _PARTS:
        _vanish(robot, part)
        rest = watch_rest(Drive(robot), f"PUT {part.path} of which some bytes were not sent", _watch_s(robot))
        if not rest.holds:
            return [rest]
    return []


def _watch_s(robot: Robot) -> float:
    return _WATCH_S * robot.watchfulness**2


def _vanish(robot: Robot, *parts: _Part) -> None:
    """Begin requests that would move the robot, ahead or back, and close their connections before they end."""
    bodies = [_body(robot, part) for part in parts]  # read first: a robot may wait for the rest of a request
    begun = []
    for part, body in zip(parts, bodies, strict=True):
        sent = body[: int(part.share * len(body))]
        promised = None if part.lacking is None else len(body) + part.lacking
        begun.append(PartialRequest(robot.rest, "PUT", part.path, sent=sent, promised=promised))
    robot.clock.sleep(_READ_S)
    for part, request in zip(parts, begun, strict=True):
        request.vanish(reset=part.reset)


def _body(robot: Robot, part: _Part) -> bytes:
    sign = 1 if part.reset else -1
    fast = robot.share_of_limits(0.3 * sign, 0.5 * sign)
    if part.path == GOAL_PATH:
        goal = (robot.map_pose() or Pose(0.0, 0.0, 0.0)).ahead(_AWAY_M)
        return body_of(goal_body(goal, robot.statement.motion.frame, "vanished"))
    return body_of(fast.twist if part.path == VELOCITY else fast.linear)
