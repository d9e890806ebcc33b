"""What is answered 406 is not done: a PUT is applied or refused, and not both (contract, several clients)."""

from http import HTTPStatus
from typing import Any, Final

import pytest

from conformance.rest.calls import JSON
from conformance.rest.interface import RestInterface
from conformance.robot.drive import Drive
from conformance.robot.geometry import Pose
from conformance.robot.goal import goal_body
from conformance.robot.message_shapes import body_of
from conformance.robot.robot import GOAL_PATH, LINEAR, STILL, VELOCITY, Robot
from conformance.robot.standstill import Standstill
from conformance.robot.stopping import bring_to_rest
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("standstill"), pytest.mark.needs("rest"), pytest.mark.motion]
_ID: Final = "http/not-acceptable-undone"
# What no robot answers a PUT in.
_NOTHING: Final = "image/png"
# Far enough, rad, that the robot is not there before anybody looks.
_TURN: Final = 2.5


@pytest.mark.requirement(_ID)
def test_what_is_not_acceptable_is_not_done(
    api: RestInterface, robot: Robot, standstill: Standstill, judge: Judge
) -> None:
    """A velocity or a goal that is answered 406 moves nothing; one that is taken all the same may."""
    refused = _try_each(api, robot, 0.0)
    if not refused:
        judge.note(_ID, "no PUT of a velocity or a goal is answered 406")
        return

    def again() -> None:
        _try_each(api, robot, robot.limits.settle_s)

    standstill.tried(_ID, "rest, and no goal, after 406", again, seconds=robot.limits.settle_s, goal=True)


def _try_each(api: RestInterface, robot: Robot, watched_s: float) -> int:
    """PUT what would move the robot where no format is acceptable, and watch each for so long. Returns how many 406."""
    fast = robot.share_of_limits(0.4, 0.4)
    values: list[tuple[str, Any]] = [(VELOCITY, fast.twist), (LINEAR, fast.linear)]
    here = robot.map_pose()
    if here is not None:
        ahead = Pose(here.x, here.y, here.yaw + _TURN)
        values.append((GOAL_PATH, goal_body(ahead, robot.statement.motion.frame, "not acceptable")))
    refused = 0
    for path, value in values:
        fields = (("Content-Type", JSON), ("Accept", _NOTHING))
        exchange = robot.rest.send("PUT", path, headers=fields, body=body_of(value))
        if exchange.response.ok:
            bring_to_rest(api)
        if exchange.response.status != HTTPStatus.NOT_ACCEPTABLE:
            continue
        refused += 1
        drive = Drive(robot)
        drive.keep(watched_s)
        still, found = drive.sees(STILL, 2)
        if still and robot.goal()[0] is not None:
            still, found = False, "a goal is active"
        robot.judge.check(
            _ID, still is not False, exchange, f"no effect of a PUT of {path} that is answered 406", found=found
        )
        if still is False:
            bring_to_rest(api)
    return refused
