"""A right gateway is never blamed, and a wrong one is by the requirement that it breaks: without a robot."""

import itertools
import json
import os
import re
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
import web_gateway
from processes import ended

from ros_probe.process import RosProcess

ROOT = Path(__file__).parents[3]
#: What this gateway, which keeps old messages for ever, is right in.
CORE = ("read-exact", "read-fresh", "read-newest", "write-exact", "once", "order", "refused-nothing")


@contextmanager
def _served(domain_id, faults=""):
    command = [sys.executable, web_gateway.__file__, "0", str(domain_id), faults]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    with Popen(command, stdout=PIPE, text=True, env=environment) as process:
        try:
            yield f"http://127.0.0.1:{process.stdout.readline().strip()}"
        finally:
            process.kill()


def _judged(tmp_path, domain_id, url, *options, ros=web_gateway.MAP, code=None):
    statement, out = tmp_path / "gateway.toml", tmp_path / "out"
    statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{ros}', encoding="utf-8")
    selected = [word for id_ in CORE for word in ("--select", f"ros-gateway/{id_}")]
    more = ["--ros-domain-id", domain_id, *selected, "--out", out, *options]
    done = ended(sys.executable, "-m", "roaas", "certify", statement, *more)
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    if code is not None:
        assert done.returncode == code, done.stdout + done.stderr
    if not (out / "result.json").exists():
        return done, {}
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    verdicts = {one["id"]: one["verdict"] for one in result["requirements"]}
    return done, {id_: verdicts[id_] for id_ in (f"ros-gateway/{core}" for core in CORE)}


def test_a_right_gateway_passes_without_a_robot(tmp_path, domain_id):
    with _served(domain_id) as url:
        done, judged = _judged(tmp_path, domain_id, url, "--ros-play")
        assert set(judged.values()) == {"pass"}, done.stdout
        assert done.returncode == 0
        again = ended(sys.executable, "-m", "roaas", "judge", tmp_path / "out")
        assert again.returncode == 0, again.stdout + again.stderr


#: Fewer operations, so that a run takes seconds.
SMALL = "\n".join(line for line in web_gateway.MAP.splitlines() if "/sequences" not in line and "/set" not in line)


@pytest.mark.parametrize(
    ("faults", "broken"),
    [
        ("rounded,dropped", {"read-exact", "once"}),
        ("nan-0,doubled", {"read-exact", "once"}),
        ("ascii,reordered", {"read-exact", "order"}),
        ("back,refused-sends,swapped", {"read-newest", "refused-nothing", "write-exact"}),
    ],
)
def test_a_fault_breaks_its_requirement_and_no_other(tmp_path, domain_id, faults, broken):
    with _served(domain_id, faults) as url:
        done, judged = _judged(tmp_path, domain_id, url, "--ros-play", "--effort", "quick", ros=SMALL)
    failed = {id_.removeprefix("ros-gateway/") for id_, verdict in judged.items() if verdict == "fail"}
    assert failed == broken, done.stdout
    assert done.returncode == 1


def test_a_failure_shows_both_ends(tmp_path, domain_id):
    with _served(domain_id, "doubles") as url:
        done, _ = _judged(tmp_path, domain_id, url, "--ros-play", "--effort", "quick", ros=SMALL)
    own = re.search(r"as ROS has it on /basic: /u?int64_value = (-?\d+) \(u?int64\)", done.stdout)
    web = re.search(r"Got 200, application/json: /u?int64_value = (-?\d+)", done.stdout)
    assert own, done.stdout
    assert web, done.stdout
    assert int(own[1]) != int(web[1]) == int(float(own[1]))
    ends = {one["operation"]: one for one in json.loads((tmp_path / "out" / "result.json").read_text())["ros"]}
    assert own[1] in ends["GET /basic"]["differs"]["ros"]
    assert web[1] in ends["GET /basic"]["differs"]["web"]
    assert ends["POST /velocity"]["compared"] > 0
    assert "differs" not in ends["POST /velocity"]
    text = (tmp_path / "out" / "certificate.md").read_text(encoding="utf-8")
    assert re.search(rf"\| `GET /basic` \| reads `/basic` .*{web[1]}.*\|.*{own[1]}", text), text
    page = (tmp_path / "out" / "certificate.html").read_text(encoding="utf-8")
    row = page.partition('id="ros"')[2].partition("</tr>")[2].partition("</tr>")[0]
    assert re.search(f"GET /basic.*reads.*BasicTypes.*web says.*{web[1]}.*ROS says.*{own[1]}", row, re.DOTALL), row


def test_what_is_missing_is_named(tmp_path, domain_id):
    with _served(domain_id) as url:
        done, _ = _judged(tmp_path, domain_id, url, "--ros-play", ros="", code=2)
        assert "give a statement with a table [ros]" in done.stderr
        strange = web_gateway.MAP.replace("GET /odom", "GET /odometry")
        done, _ = _judged(tmp_path, domain_id, url, "--ros-play", ros=strange, code=2)
        assert "[ros.operations] names 'GET /odometry', which the description does not have" in done.stderr
        unknown = web_gateway.MAP.replace("nav_msgs/msg/Odometry", "nope_msgs/msg/Odometry")
        done, judged = _judged(tmp_path, domain_id, url, "--ros-play", "--effort", "quick", ros=unknown, code=4)
        assert judged["ros-gateway/read-exact"] == "skip"
        result = (tmp_path / "out" / "result.json").read_text(encoding="utf-8")
        assert "the package nope_msgs is not installed: apt install ros-jazzy-nope-msgs" in result
        done, judged = _judged(tmp_path, domain_id, url, "--ros", code=4)
        assert judged["ros-gateway/once"] == "skip"
        result = (tmp_path / "out" / "result.json").read_text(encoding="utf-8")
        assert "give --ros-play (the suite is the robot) or --allow-motion" in result


class _Moving(threading.Thread):
    """A robot that moves: it publishes another odometry ten times a second, until it is told to end."""

    def __init__(self, domain_id):
        super().__init__(daemon=True)
        self.process, self.ends = RosProcess("robot", domain_id=domain_id), threading.Event()
        self.process.await_ready()

    def run(self):
        for number in itertools.count(1):
            value = {"child_frame_id": f"Zürich {number}", "pose": {"pose": {"position": {"x": number / 3}}}}
            self.process.tell("publish", topic="/odom", type="nav_msgs/msg/Odometry", values=[value])
            if self.ends.wait(0.1):
                return

    def end(self):
        self.ends.set()
        self.join()
        self.process.close()


@pytest.mark.parametrize(("faults", "broken"), [("", set()), ("rounded", {"read-exact"}), ("frozen", {"read-fresh"})])
def test_a_gateway_is_judged_beside_a_robot(tmp_path, domain_id, faults, broken):
    robot = _Moving(domain_id)
    ros = "\n".join(line for line in SMALL.splitlines() if "/basic" not in line)
    with _served(domain_id, faults) as url:
        robot.start()
        try:
            done, judged = _judged(tmp_path, domain_id, url, "--ros", "--allow-motion", ros=ros)
        finally:
            robot.end()
    failed = {id_.removeprefix("ros-gateway/") for id_, verdict in judged.items() if verdict == "fail"}
    if faults == "frozen" and failed == {"read-exact"}:
        return  # on a busy machine it stood still before the suite listened, at a message that nobody heard
    assert failed == broken, done.stdout
    assert "skip" not in judged.values(), done.stdout
