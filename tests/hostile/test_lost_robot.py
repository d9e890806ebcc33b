"""A robot that cannot be stopped is named before everything else; one that comes back in time is stopped."""

import datetime as dt
import json
import os
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import moving_cart
import moving_winch
import msgspec
import pytest
from aiohttp import web
from lxml import etree
from moving_winch import Winch
from processes import ended, free_port
from small_device import REFUSED, answers, certified, constant, described, error, reading, small_device
from soap_devices import serving

from conformance.api.rest.stops import UNDELIVERED
from conformance.commandline.exit_codes import ExitCode
from conformance.contract.described import MOTION
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.fleet.fleet_file import Member
from conformance.fleet.member_run import MemberResult, Outcome
from conformance.fleet.result import exit_code, fleet_document
from conformance.scenarios.motion.binding import binding_of
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import load_statement
from conformance.target.describing import described_contract, soap_contract
from conformance.transport.client import Connection
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run
from reports.fleet import fleet_html, fleet_markdown
from reports.formats.catalogue import latency_junit
from reports.latency.page import latency_html, latency_markdown

_DATA = Path(__file__).parents[1] / "reports" / "data"


@dataclass(frozen=True)
class Fault:
    """What a moving robot does from its first move on.

    Attributes:
        name: of the fault, as moving_cart.py knows it.
        said: is in the reason why it may still move; empty: it is stopped, and nothing is said.
    """

    name: str
    said: str


FAULTS = (
    Fault("hang", "POST /stop: no response within"),
    Fault("silent", "POST /stop: no response within"),
    Fault("crash", "POST /stop: no connection"),
    Fault("closes", "POST /stop: the server closed the connection"),
    Fault("ignores", "the device does not come to rest, as GET /state shows"),
    Fault("401", "POST /stop got status 401"),
    Fault("503", "POST /stop got status 503"),
    Fault("pause", ""),
    Fault("late", ""),
    Fault("none", ""),
)


@contextmanager
def cart(fault: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Serve a cart; yields its base URL and its process."""
    port = free_port()
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    command = [sys.executable, str(Path(moving_cart.__file__)), str(port), fault]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            yield f"http://127.0.0.1:{port}", process
        finally:
            process.kill()


def robot_at(url: str, folder: Path, motion: str, wsdl: str = "") -> RobotUnderTest:
    """Return a device with a motion map, connected, as a run that may move it has it."""
    where, connection = Endpoints(), Connection(timeout_s=1.0)
    if wsdl:
        contract, where, _ = soap_contract(f"{url}/{wsdl}", None, where, connection, folder, mapped={MOTION})
    else:
        contract, where, _ = described_contract(
            f"{url}/openapi.json", (), None, where, connection, folder, mapped={MOTION}
        )
    (folder / "robot.toml").write_text(motion, encoding="utf-8")
    statement = msgspec.structs.replace(load_statement(folder / "robot.toml", contract), endpoints=where)
    robot = RobotUnderTest(Run(statement, contract, allow_motion=True, stop_s=3.0), connection)
    robot.connect()
    return robot


def driven(robot: RobotUnderTest, speeds: dict[str, float]) -> None:
    """Give a device a velocity."""
    assert robot.rest is not None
    assert robot.run.statement.motion_map is not None
    mapped = MappedDevice(robot.rest, robot.run.statement.motion_map, binding=binding_of(robot.rest))
    with suppress(NoAnswerError):
        mapped.drive(speeds)


def where(url: str) -> float:
    """Return where a cart is."""
    with urllib.request.urlopen(f"{url}/state", timeout=60) as answer:  # noqa: S310 - http
        x: float = json.load(answer)["x"]
    return x


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_robot_is_stopped_or_it_is_said_that_it_may_still_move(fault, tmp_path):
    with cart(fault.name) as (url, _):
        robot = robot_at(url, tmp_path, moving_cart.MAP)
        driven(robot, {"ahead": 0.5})
        robot.stop()
        if not fault.said:
            assert robot.run.stop_undelivered == ""
            here = where(url)
            time.sleep(0.1)
            assert where(url) == here
            return
        assert robot.run.stop_undelivered.startswith(f"{UNDELIVERED}: ")
        assert fault.said in robot.run.stop_undelivered


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("silent", "no response within"),
        ("refuses", "POST /winch got status 500, text/xml"),
        ("ignores", "the device does not come to rest"),
        ("none", ""),
    ],
)
def test_a_device_over_soap_is_stopped_or_it_is_said_that_it_may_still_move(fault, said, tmp_path):
    with serving(Winch(fault)) as url:
        robot = robot_at(url, tmp_path, moving_winch.MAP, "winch.wsdl")
        driven(robot, {"ahead": 0.5})
        robot.stop()
    assert robot.run.stop_undelivered.startswith(f"{UNDELIVERED}: " if said else "")
    assert said in robot.run.stop_undelivered
    assert bool(robot.run.stop_undelivered) == bool(said)


def test_a_robot_that_hangs_while_it_moves_fails_and_that_it_may_still_move_comes_first(tmp_path):
    statement, out = tmp_path / "robot.toml", tmp_path / "out"
    with cart("hang") as (url, _):
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{moving_cart.MAP}', encoding="utf-8")
        outcome = certified(
            statement, out, "--allow-motion", "--class", "motion", "--timeout", "1", "--wait", "1", "--quiet"
        )
    assert outcome.exit_code == 1
    assert outcome.text.startswith(f"WARNING: {UNDELIVERED}: POST /stop: no response within")
    assert outcome.result["stop_undelivered"] == outcome.result["notes"][0]
    assert outcome.result["stop_undelivered"].startswith(UNDELIVERED)
    (failure,) = outcome.requirement("robustness/no-hang")["failures"]
    assert failure["request"]["url"].endswith("/velocity")
    ended(sys.executable, "-m", "roaas", "report", out, "--format", "sarif", check=True)
    assert f"WARNING: {UNDELIVERED}" in (out / "certificate.md").read_text(encoding="utf-8").splitlines()[0]
    page = (out / "certificate.html").read_text(encoding="utf-8")
    assert page.index(UNDELIVERED) < page.index("<header")
    first = etree.parse(out / "junit.xml").find("testsuite/testcase")
    assert first.find("error").get("message").startswith(UNDELIVERED)
    (sarif,) = out.glob("*.sarif")
    assert json.loads(sarif.read_text(encoding="utf-8"))["runs"][0]["results"][0]["message"]["text"].startswith(
        UNDELIVERED
    )


class _Crane:
    """A crane whose moves fail with 500 and move it all the same; ``halts`` is the status of its stop."""

    def __init__(self) -> None:
        self.called, self.halts = list[str](), 200

    async def go(self, _: web.Request) -> web.Response:
        self.called.append("go")
        return error(500, "broken")

    async def halt(self, _: web.Request) -> web.Response:
        self.called.append("halt")
        return web.json_response({}, status=self.halts)


def test_replay_stops_what_it_has_moved_and_says_where_it_could_not(tmp_path):
    responses = {"200": answers({"type": "object"}), "5XX": REFUSED}
    paths = {
        "/state": reading({"type": "object"}),
        "/go": {"post": {"responses": responses}},
        "/halt": {"post": {"responses": responses, "x-roaas-stop": True}},
    }
    crane = _Crane()
    routes = {"/state": constant({}), "/go": {"POST": crane.go}, "/halt": {"POST": crane.halt}}
    with small_device(described(paths), routes) as url:
        outcome = certified(
            f"{url}/openapi.json", tmp_path, "--call", "POST /go", "--allow-motion", "--class", "robustness"
        )
        assert "go" in crane.called
        assert crane.called[-1] == "halt"
        assert "stop_undelivered" not in outcome.result
        command = (sys.executable, "-m", "roaas", "replay", tmp_path, "robustness/no-server-error", "--allow-motion")
        crane.called.clear()
        done = ended(*command)
        assert (done.returncode, crane.called[0], crane.called[-1]) == (1, "go", "halt"), done.stdout
        assert UNDELIVERED not in done.stdout
        crane.halts = 503
        done = ended(*command)
    assert done.stdout.startswith(f"WARNING: {UNDELIVERED}: POST /halt got status 503"), done.stdout
    assert done.returncode == 1


_MOVING = {"stop_undelivered": f"{UNDELIVERED}: POST /stop got status 503"}


def test_a_fleet_says_which_robot_may_still_move():
    member = Member("crane", Path("crane.toml"), Endpoints(), ("crane", ""), None, movable=True, time_limit_s=None)
    found = json.loads((_DATA / "described-example.json").read_text(encoding="utf-8")) | _MOVING
    result = MemberResult(member, Outcome.CONFORMANT, ExitCode.INCONCLUSIVE, document=found)
    assert exit_code([result], interrupted=False) == ExitCode.INCONCLUSIVE
    now = dt.datetime.now(dt.UTC)
    document = fleet_document([result], started=now, finished=now, parallel=1, interrupted=False)
    assert document["robots"][0]["stop_undelivered"] == _MOVING["stop_undelivered"]
    assert UNDELIVERED in fleet_markdown(document).splitlines()[0]
    page = fleet_html(document)
    assert page.index(UNDELIVERED) < page.index("<header")


def test_a_load_test_s_pages_begin_with_it():
    found = json.loads((_DATA / "latency-example.json").read_text(encoding="utf-8")) | _MOVING
    page = latency_html(found, "latency.json")
    assert page.index(UNDELIVERED) < page.index("<header")
    assert UNDELIVERED in latency_markdown(found, "latency.json").splitlines()[0]
    assert UNDELIVERED in latency_junit(found)
