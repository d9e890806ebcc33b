"""How fast a robot answers is seen before anything is judged, and does not hang on one answer."""

import itertools
import time

import pytest

from conformance.contract.interfaces import Interface
from conformance.contract.statement import Endpoints, Statement
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.transport.client import Connection
from conformance.verdict.run import Run


@pytest.fixture
def robot_of(listening):
    """A robot whose answers take so many seconds, each in its turn, on one connection."""

    def make(*delays):
        turns = itertools.cycle(delays)

        def answer(sock):
            while sock.recv(65536):
                time.sleep(next(turns))
                sock.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")

        statement = Statement(endpoints=Endpoints(rest=listening(answer)))
        robot = RobotUnderTest(Run(statement=statement), Connection(timeout_s=1.0))
        robot.connect()
        return robot

    return make


def test_two_late_answers_in_eleven_make_no_robot_slow(robot_of):
    robot = robot_of(0.2, *[0.0] * 4, 0.2, *[0.0] * 5)
    assert robot.connection.sent == 11
    assert robot.run.effort.speed.name == "local"


def test_a_slow_robot_is_asked_less_often_for_it(robot_of):
    robot = robot_of(0.3)
    assert robot.connection.sent == 5
    assert robot.run.effort.speed.name == "far"
    assert robot.connection.pace.usual_s == pytest.approx(robot.run.effort.usual_ms / 1000)
    assert robot.connection.pace.usual_s >= 0.3


def test_an_interface_that_hangs_is_put_down(robot_of):
    robot = robot_of(5.0)
    assert "no answer" in robot.run.unreachable[Interface.REST]
    assert not robot.reached
