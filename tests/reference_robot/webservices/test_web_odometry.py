"""When a message of odometry is worked out: once, and before anybody asks where message after message is asked for."""

import math
import time

import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message

from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.robot.odometry import LatestOdometry


class Subscribers:
    """Stands for the node: what a test says comes."""

    def __init__(self):
        self.odometry = (None, 0.0)

    def come(self, x):
        message = Odometry()
        message.pose.pose.position.x = x
        octets = serialize_message(message)
        self.on_odometry(octets)
        self.odometry = octets, time.monotonic()


class Writer:
    """Writes x, and remembers of which messages it did."""

    def __init__(self):
        self.wrote = []

    def __call__(self, plain):
        self.wrote.append(plain["pose"]["pose"]["position"]["x"])
        return self.wrote[-1]


@pytest.fixture
def robot():
    return Subscribers()


@pytest.fixture
def odometry(robot):
    return LatestOdometry(robot)


def test_a_message_is_written_once_however_often_it_is_asked_for(robot, odometry):
    writer = Writer()
    robot.come(1.0)
    assert [odometry.write_latest(writer) for _ in range(3)] == [1.0] * 3
    assert writer.wrote == [1.0]
    assert odometry.message() is odometry.message()


def test_an_idle_robot_writes_nothing(robot, odometry):
    writer = Writer()
    for x in range(5):
        robot.come(float(x))
    assert writer.wrote == []
    assert odometry.write_latest(writer) == 4.0


def test_whoever_asks_for_each_message_finds_the_next_one_written(robot, odometry):
    writer = Writer()
    for x in (1.0, 2.0):
        robot.come(x)
        assert odometry.write_latest(writer) == x
    robot.come(3.0)
    assert writer.wrote == [1.0, 2.0, 3.0]
    assert odometry.write_latest(writer) == 3.0
    robot.come(4.0)
    assert writer.wrote[-1] == 4.0
    robot.come(5.0)  # the fourth was written in vain: nobody asks any more
    assert writer.wrote == [1.0, 2.0, 3.0, 4.0]
    assert odometry.write_latest(writer) == 5.0


def test_whoever_asks_now_and_then_has_nothing_written_in_vain(robot, odometry):
    writer = Writer()
    for turn in range(6):
        for each in range(3):
            robot.come(turn + each / 10)
        assert odometry.write_latest(writer) == turn + 0.2
    assert len(writer.wrote) == 6


def test_each_format_is_written_beforehand_for_those_who_ask_for_it(robot, odometry):
    often, once = Writer(), Writer()
    for x in (1.0, 2.0, 3.0):
        robot.come(x)
        odometry.write_latest(often)
        if x == 2.0:
            assert odometry.write_latest(once) == 2.0
    robot.come(4.0)
    assert (often.wrote, once.wrote) == ([1.0, 2.0, 3.0, 4.0], [2.0])


def test_a_value_that_is_not_finite_is_told_to_whoever_asks_and_stops_nothing(robot, odometry):
    writer = Writer()
    for x in (1.0, 2.0):
        robot.come(x)
        odometry.write_latest(writer)
    robot.come(math.nan)  # in ROS's thread, which must not end by it
    with pytest.raises(Problem, match=r"position\.x is nan") as refused:
        odometry.write_latest(writer)
    assert refused.value.status == 503
    robot.come(3.0)
    assert odometry.write_latest(writer) == 3.0
