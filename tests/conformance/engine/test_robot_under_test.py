"""How fast a robot answers is seen before anything is judged, and does not hang on one answer."""

import io
import itertools
import time

import pytest
from aiohttp import web
from small_device import constant, small_device

from conformance.contract.classes import Interface
from conformance.engine import robot_under_test
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.packs.table1.statement import Statement
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.statement.endpoints import Endpoints
from conformance.transport.client import Connection
from conformance.transport.exchange import NoAnswer, NoAnswerError
from conformance.verdict.run import Run


@pytest.fixture
def robot_of(listening):
    """A robot whose answers take so many seconds, each in its turn, on one connection."""

    def make(*delays, progress=None):
        turns = itertools.cycle(delays)

        def answer(sock):
            while sock.recv(65536):
                time.sleep(next(turns))
                sock.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")

        statement = Statement(endpoints=Endpoints(rest=listening(answer)))
        robot = RobotUnderTest(Run(statement=statement), Connection(timeout_s=1.0))
        robot.connect(progress)
        return robot

    return make


def test_two_late_answers_in_eleven_make_no_robot_slow(robot_of):
    robot = robot_of(0.2, *[0.0] * 4, 0.2, *[0.0] * 5)
    assert (robot.connection.sent, robot.run.effort.speed.name) == (11, "local")


def test_a_slow_robot_is_asked_less_often_for_it(robot_of):
    robot = robot_of(0.3)
    assert (robot.connection.sent, robot.run.effort.speed.name) == (5, "far")
    assert robot.connection.pace.usual_s == pytest.approx(robot.run.effort.usual_ms / 1000)
    assert robot.connection.pace.usual_s >= 0.3


def test_an_interface_that_hangs_is_put_down(robot_of):
    robot = robot_of(5.0)
    assert "no response" in robot.run.unreachable[Interface.REST]
    assert not robot.was_reached


def test_what_hung_at_first_is_sent_again_by_the_checks(robot_of):
    robot = robot_of(5.0)
    with pytest.raises(NoAnswerError) as none:
        robot.rest.client.send("GET", robot.rest.path)
    assert none.value.unanswered.kind is NoAnswer.TIMEOUT


@pytest.mark.parametrize(("takes_s", "told"), [(0.3, 1), (0.0, 0)])
def test_who_waits_long_is_told_for_what(robot_of, monkeypatch, takes_s, told):
    monkeypatch.setattr(robot_under_test, "_SILENT_S", 1.0)
    progress = io.StringIO()
    robot = robot_of(takes_s, progress=progress)
    waits = f"rest: waiting for {robot.run.statement.endpoints.rest}, up to 1 s for each answer\n"
    assert progress.getvalue() == told * waits


async def _refused(_):
    return web.Response(status=500)  # as to an empty Body


def _wsdls(publishers, subscribers):
    """Return a robot with two SOAP services, and with these texts as their WSDLs."""

    def serving(wsdl):
        async def read(_):
            return web.Response(text=wsdl, content_type="text/xml")

        return {"GET": read, "POST": _refused}

    return {"/publishers": serving(publishers), "/subscribers": serving(subscribers), "/state": constant({"x": 1})}


_ACTS, _READS = ((CONTRACT_DIR / f"{name}.wsdl").read_text(encoding="utf-8") for name in Interface if name != "rest")


@pytest.mark.parametrize(
    ("given", "wsdl", "why"),
    [
        ("/subscribers?wsdl", _READS, ""),
        ("/subscribers?wsdl", _READS.replace("</wsdl:definitions>", ""), ""),
        ("/publishers?wsdl", _READS, "describes another service, with the operations ExecuteCoffeeRequest"),
        ("/none?wsdl", _READS, "returned status 404, application/json and no WSDL, and POST"),
        ("/state", _READS, "returned status 200, application/json and no WSDL, and POST"),
    ],
    ids=[
        "its WSDL",
        "a WSDL with a fault",
        "that of the other service",
        "a path that is not there",
        "another resource",
    ],
)
def test_a_wrong_wsdl_is_one_finding_that_says_what_to_give(given, wsdl, why):
    with small_device({}, _wsdls(_ACTS, wsdl)) as url:
        where = Endpoints(publishers_wsdl=f"{url}/publishers?wsdl", subscribers_wsdl=f"{url}{given}")
        robot = RobotUnderTest(Run(statement=Statement(endpoints=where), allow_motion=True), Connection(timeout_s=5.0))
        robot.connect()
    said = robot.run.unreachable.get(Interface.SUBSCRIBERS, "")
    assert (why in said, bool(said)) == (True, bool(why)), said
    assert not why or said.endswith("name the WSDL of the subscribers service with --subscribers-wsdl")
    assert Interface.PUBLISHERS not in robot.run.unreachable
