"""The whole of it against the reference robot."""

import os
import re
import signal
import subprocess
import sys

import pytest


@pytest.fixture
def robot(domain_id):
    """The reference robot: (REST URL, publishers' WSDL, subscribers' WSDL)."""
    command = [sys.executable, "-m", "roaas", "robot", "--rest-port=0", "--soap-port=0", f"--domain-id={domain_id}"]
    environment = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    found = re.search(r"ready rest=(\S+) soap=(\S+)", process.stdout.readline())
    assert found, "the robot did not come up"
    yield found[1], found[2], found[2].replace("publisher_ws", "subscriber_ws")
    process.send_signal(signal.SIGINT)
    process.wait(60)
    process.stdout.close()


def test_the_reference_robot_is_measured_over_both_interfaces(robot, load):
    rest, publishers, subscribers = robot
    run = load(
        f"--rest {rest} --publishers-wsdl {publishers} --subscribers-wsdl {subscribers}",
        "--allow-motion --rate 100 --duration 4 --warmup 1",
    )
    result = run.result
    assert run.code == (0 if result["valid"] else 4), run.err
    assert not any("equivalent" in reason for reason in result["invalid_because"]), result["invalid_because"]
    assert len(result["series"]) == 8
    for series in result["series"]:
        assert series["count"] > 10
        assert series["errors"] == 0
        spans = series["spans_ms"]
        assert spans["server"]["p50"] > 0, "the reference robot sends Server-Timing"
        whole = sum(spans[name]["mean"] for name in ("build", "wire", "server", "parse"))
        assert whole == pytest.approx(series["service_ms"]["mean"], rel=1e-3)
    wire = {entry["operation"]: entry for entry in result["comparisons"] if entry["client"] == "wire"}
    assert set(wire) == {"delivery", "pose"}
    assert result["environment"]["robot_command"]
