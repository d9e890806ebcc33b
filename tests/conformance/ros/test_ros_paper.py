"""The paper's robot behind its own gateway passes by the ROS map of its example, also with the suite as robot."""

import json
import re
import sys
import tomllib
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
from processes import ended

EXAMPLES = Path(__file__).parents[3] / "examples" / "paper_robot"
SELECTED = ("read-exact", "read-newest", "write-exact", "once", "refused-nothing")
#: What the suite judges as the robot.
PLAYED = (*SELECTED, "goal-once", "goal-outcome", "goal-cancel", "goal-rejected", "lists", "recovers")


@contextmanager
def _robot(domain_id, starts):
    """Start the reference robot; yield its addresses over REST and SOAP."""
    command = [sys.executable, "-m", "roaas", "robot", "--rest-port", "0", "--soap-port", "0", *starts, "--domain-id"]
    with Popen([*command, str(domain_id)], stdout=PIPE, text=True) as robot:
        try:
            yield next(
                found.groups() for line in robot.stdout if (found := re.search(r"rest=(\S+) soap=(\S+?)/turtle", line))
            )
        finally:
            robot.terminate()


@pytest.mark.parametrize(
    ("example", "starts", "way", "selected"),
    [
        ("paper-robot", [], "--ros", SELECTED),
        ("paper-robot", ["--attach"], "--ros-play", PLAYED),
        ("soap-reads", ["--attach"], "--ros-play", ("read-exact", "read-fresh", "read-newest", "lists")),
        ("soap-sends", ["--attach"], "--ros-play", ("write-exact", "once", "order", "refused-nothing")),
    ],
)
def test_the_reference_robot_passes_by_the_map_of_the_example(tmp_path, domain_id, example, starts, way, selected):
    wanted = [f"ros-gateway/{name}" for name in selected]
    with _robot(domain_id, starts) as urls:
        statement = tmp_path / "robot.toml"
        text = (EXAMPLES / f"{example}.toml").read_text(encoding="utf-8")
        for usual, url in zip(("http://127.0.0.1:7003", "http://127.0.0.1:5555"), urls, strict=True):
            text = text.replace(usual, url)
        statement.write_text(text, encoding="utf-8")
        options = [way, "--ros-domain-id", domain_id, "--allow-motion", "--effort", "quick", "--out", tmp_path]
        options += [word for id_ in wanted for word in ("--select", id_)]
        done = ended(sys.executable, "-m", "roaas", "certify", statement, *options)
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    verdicts = {one["id"]: one["verdict"] for one in result["requirements"]}
    assert {id_: verdicts[id_] for id_ in wanted} == dict.fromkeys(wanted, "pass"), done.stdout
    assert all(one["compared"] for one in result["ros"] if starts or one["does"] == "reads"), result["ros"]
    assert "still move" not in done.stdout + done.stderr  # it is no robot of ours where the suite plays it


def test_a_map_of_the_soap_services_is_proposed(tmp_path, domain_id):
    odometry = {"topic": "/odom", "type": "nav_msgs/msg/Odometry", "at": "/return"}
    type_ = "mybot_delivery_app/msg/DeliveryRequestMsg"
    delivery = {"publishes": "/DeliveryRequestMsg/from_json", "type": type_, "at": "/arg0"}
    wanted = {
        "subscriber": {"Subscribers": {"GetPose": odometry}},
        "publisher": {"Publishers": {"ExecuteCoffeeRequest": delivery, "ExecuteDeliveryRequest": delivery}},
    }
    with _robot(domain_id, []) as (_, soap):
        for service, ports in wanted.items():
            path = tmp_path / f"{service}.toml"
            more = ["--init", f"{soap}/turtlesim_{service}_ws?wsdl", "--ros", "--ros-domain-id", domain_id, path]
            done = ended(sys.executable, "-m", "roaas", "certify", *more)
            assert done.returncode == 0, done.stdout + done.stderr
            text = path.read_text(encoding="utf-8")
            for port, operations in ports.items():
                named = {f"POST /Turtlebot{port}WebServicePort/{name}": keys for name, keys in operations.items()}
                assert tomllib.loads(text)["ros"]["operations"] == named
    read = (tmp_path / "subscriber.toml").read_text(encoding="utf-8")
    # What the messages suggest, and nobody has read.
    assert re.search(r'^# "\S+ \S+/GetSensors" = \{ lists = "topics".+name = "/topic"', read, re.MULTILINE), read
    assert re.search(r'commands\.\n# "\S+ \S+/GetVelocity" = \{ topic = "/cmd_vel"', read), read
