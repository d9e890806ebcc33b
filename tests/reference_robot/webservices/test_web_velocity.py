"""PUT velocity: what reaches cmd_vel, and what is refused and does not."""

import asyncio

import pytest
from web_messages import goal, twist
from web_robot import ForeignRobot, eventually, problem, running_robot

from reference_robot.webservices.configuration import WebSettings
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.robot.velocity import Velocity

VELOCITY = "/robot/velocity/"
LINEAR = "/robot/velocity/linear/"
GOAL = "/robot/navigation/action/goal/"


def test_put_is_published_once_and_answered_with_what_was_accepted(served, foreign):
    answer = served.call("PUT", VELOCITY, json=twist(x=0.5, z=-1))
    assert (answer.status_code, answer.json()) == (200, twist(x=0.5, z=-1.0))
    assert foreign.next("velocity") == {"type": "Twist", "x": 0.5, "z": -1.0}
    assert foreign.heard_nothing()


def test_what_another_body_cannot_drive_is_refused(domain_id, tmp_path):
    config = tmp_path / "robot.toml"
    config.write_text("[web]\nmax_reverse = 0\nmax_lateral = 0.3\nmin_radius = 0.5\nlag = 0.01\n")
    aside = twist() | {"linear": {"x": 0.0, "y": -0.3, "z": 0.0}}
    with (
        ForeignRobot(domain_id, "Twist") as foreign,
        running_robot(domain_id, "--attach", f"--config={config}") as served,
    ):
        eventually(lambda: served.call("PUT", VELOCITY, json=aside).status_code == 200)
        assert served.call("PUT", VELOCITY, json=twist(x=0.6, z=1.1)).status_code == 200
        eventually(lambda: foreign.next("velocity")["x"] == 0.6)
        for value, name in (
            (twist(x=-0.1), "linear.x"),
            (twist(x=0.0, z=0.1), "angular.z"),
            (twist(x=0.6, z=1.3), "angular.z"),
        ):
            assert name in problem(served.call("PUT", VELOCITY, json=value), 422)
        # The angular part that is in force counts as well.
        assert "angular.z" in problem(served.call("PUT", LINEAR, json={"x": 0.5, "y": 0.0, "z": 0.0}), 422)
        assert foreign.heard_nothing()


def test_a_robot_that_takes_stamped_twists_gets_them(domain_id):
    with ForeignRobot(domain_id, "TwistStamped") as stamped, running_robot(domain_id, "--attach") as served:
        eventually(lambda: served.call("PUT", VELOCITY, json=twist(x=0.3, z=0.2)).status_code == 200)
        assert stamped.next("velocity") == {"type": "TwistStamped", "x": 0.3, "z": 0.2}


def test_without_a_robot_commands_are_not_accepted(domain_id):
    with running_robot(domain_id, "--attach") as served:
        for answer in (
            served.call("PUT", VELOCITY, json=twist()),
            served.call("PUT", GOAL, json=goal()),
            served.call("PUT", "/robot/app/delivery/4/depot_x/1/depot_y/1/dest_x/1/dest_y/1/source_x/1/source_y/1"),
            served.call("GET", "/robot/navigation/service/plan?x=1&y=1"),
        ):
            problem(answer, 503)
        for path in ("/robot/app/delivery/", "/robot/sensors/", "/robot/navigation/services/"):
            assert served.call("GET", path).json() == []


class BusyMiddleware:
    """Middleware that does not accept the second message and the two after it in time, as on a loaded machine."""

    def __init__(self):
        self.sent = []
        self.accepted = asyncio.Event()

    def find_velocity_subscribers(self):
        return True

    def publish_velocity(self, message):
        self.sent.append(message.linear.x)
        if len(self.sent) == 5:
            self.accepted.set()
        return len(self.sent) not in {2, 3, 4}

    def await_velocity_taken(self):
        """Do nothing."""


@pytest.mark.parametrize("ended_by", ["client", "watchdog", "end of the process"])
def test_a_stop_that_the_middleware_does_not_accept_is_sent_again(ended_by):
    middleware = BusyMiddleware()
    velocity = Velocity(middleware, None, WebSettings(hold=0.05 if ended_by == "watchdog" else 60.0), lambda: False)

    async def drive_and_stop():
        await velocity.command(twist(x=0.1))
        if ended_by == "client":
            await velocity.command(twist(x=0.0))
        if ended_by == "watchdog":
            await asyncio.wait_for(middleware.accepted.wait(), 60)

    asyncio.run(drive_and_stop())
    if ended_by == "end of the process":
        velocity.close()
    assert middleware.sent == [0.1, 0.0, 0.0, 0.0, 0.0]


def test_a_velocity_that_the_middleware_does_not_accept_is_503():
    velocity = Velocity(BusyMiddleware(), None, WebSettings(), lambda: False)

    async def drive():
        await velocity.command(twist(x=0.1))
        await velocity.command(twist(x=0.2))

    with pytest.raises(Problem, match="fast enough"):
        asyncio.run(drive())
