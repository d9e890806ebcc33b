"""Commands that are still underway to a robot at rest: what it begins before it has had its time is no fault."""

import time
from contextlib import contextmanager

from toy_server import serving

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.robot import GOAL_PATH, POSE, STILL, Robot, Velocity
from conformance.packs.table1.robot.stopping import await_rest
from conformance.packs.table1.scenarios.goal_life import cancel
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

_SETTLE_S = 0.6
# The first command takes so long, and zero so much longer: the robot turns in between.
_LATE_S, _LASTS_S = 0.25, 0.2
_SAMPLE_S = 0.02
_ZERO = dict.fromkeys("xyz", 0.0)


class _Body:
    """A robot that turns for a moment, a while after it is told to move and to stop."""

    def __init__(self) -> None:
        self.told = float("-inf")

    def answer(self, method: str, path: str, _sent: bytes) -> tuple[int, object]:
        now = time.monotonic()
        if method != "GET":
            return 204, None
        sampled = now // _SAMPLE_S * _SAMPLE_S
        turns = self.told + _LATE_S <= sampled <= self.told + _LATE_S + _LASTS_S
        twist = {"linear": _ZERO, "angular": {**_ZERO, "z": 0.7 if turns else 0.0}}
        if path == POSE:
            stamp = {"sec": int(sampled), "nanosec": int(sampled % 1 * 1e9)}
            pose = {"position": _ZERO, "orientation": {**_ZERO, "w": 1.0}}
            odometry = {"header": {"stamp": stamp, "frame_id": "odom"}, "child_frame_id": "base_link"}
            covariance = [0.0] * 36
            odometry |= {key: {key: one, "covariance": covariance} for key, one in (("pose", pose), ("twist", twist))}
            return 200, odometry
        if path == GOAL_PATH:
            return 404, None
        return 200, _ZERO if path.endswith("/linear/") else twist


@contextmanager
def _told():
    body = _Body()
    declared = DeclaredLimits(linear_m_s=0.7, angular_rad_s=2.5, settle_s=_SETTLE_S)
    with serving(body.answer) as url:
        client = HttpClient(url, Connection())
        api = RestInterface(Run(statement=Statement(declared=declared), allow_motion=True), client)
        robot = Robot(api)
        body.told = time.monotonic()
        robot.put_velocity(Velocity(angular_z=0.7))
        yield api, robot
        client.close()


def _rests(robot: Robot) -> bool:
    drive = Drive(robot)
    drive.keep(_SETTLE_S)
    return all(robot.near(turn.velocity, STILL) for turn in drive.trace.turns)


def test_an_attempt_is_not_begun_before_the_last_command_has_had_its_time():
    with _told() as (api, robot):
        await_rest(api, settled=True)
        assert _rests(robot)


def test_what_a_cancelled_goal_had_commanded_does_not_come_back():
    with _told() as (_, robot):
        assert cancel(robot).gone
        assert _rests(robot)
