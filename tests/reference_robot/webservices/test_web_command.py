"""The command: its one line, its signals, its errors; tokens; the simulation as its child."""

import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from processes import ended
from web_messages import delivery_envelope, delivery_path, goal, twist
from web_robot import eventually, problem, ros_environment, running_robot, usage_error

COMMAND = [sys.executable, "-m", "reference_robot", "--rest-port=0", "--soap-port=0"]
READY = re.compile(
    r"ready rest=http://127\.0\.0\.1:\d+ soap=http://127\.0\.0\.1:\d+/turtlesim_publisher_ws\?wsdl domain=(\d+)\n"
)


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def segments(*pids: int) -> set[Path]:
    """Return the files in shared memory through which Fast DDS sends what processes publish, half a megabyte each."""
    maps = "".join(Path(f"/proc/{pid}/maps").read_text() for pid in pids)
    return set(map(Path, re.findall(r"/\S+/fastrtps_[0-9a-f]{16}\b", maps)))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_one_line_and_a_clean_end(domain_id, number):
    with subprocess.Popen(
        [*COMMAND, f"--domain-id={domain_id}"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ros_environment(),
    ) as process:
        assert READY.fullmatch(process.stdout.readline())[1] == str(domain_id)
        (child,) = children(process.pid)
        used = segments(process.pid, child)
        process.send_signal(number)
        stdout, stderr = process.communicate(timeout=240)
        assert process.returncode == 0, stderr
        assert stdout == ""
        assert "Traceback" not in stderr
    eventually(lambda: not alive(child))
    assert used
    assert not [path for path in used if path.exists()]


def test_a_signal_while_starting_ends_it_cleanly(domain_id):
    with subprocess.Popen([*COMMAND, f"--domain-id={domain_id}"], env=ros_environment()) as process:
        child = eventually(lambda: children(process.pid))[0]
        process.terminate()
        assert process.wait(60) == 0
    eventually(lambda: not alive(child))


def test_the_simulation_does_not_outlive_a_killed_robot(domain_id):
    with running_robot(domain_id) as served:
        (child,) = children(served.process.pid)
        served.process.kill()
        eventually(lambda: not alive(child))


def test_the_robot_ends_with_its_simulation(domain_id):
    with running_robot(domain_id) as served:
        (child,) = children(served.process.pid)
        os.kill(child, signal.SIGKILL)
        assert served.process.wait(60) == 3
        said = served.process.stderr.read()
        assert "ended unexpectedly" in said
        (log,) = set(re.findall(r"log is (\S+)", said))
        assert Path(log).is_file()


@pytest.mark.parametrize("package", ["rclpy", "mybot_delivery_app", "nav2_msgs", "httptools"])
def test_a_missing_package_is_named_with_its_remedy(package):
    program = f"import sys; sys.modules[{package!r}] = None; from reference_robot.cli import robot; robot(['--attach'])"
    done = ended(sys.executable, "-c", program)
    assert (done.returncode, package in done.stderr) == (2, True), done.stderr
    assert "pip install" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_in_use_and_an_address_that_is_not_ours_are_named():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        for named, option in ((str(port), f"--soap-port={port}"), ("192.0.2.1", "--host=192.0.2.1")):
            command = [*COMMAND, "--attach", "--insecure", option]
            done = ended(*command, env=ros_environment())
            assert (done.returncode, done.stdout) == (2, "")
            assert named in done.stderr
            assert "Traceback" not in done.stderr


# What follows is wrong before anything has started, and needs no process of its own.


def test_a_configuration_that_cannot_be_used_is_named(tmp_path):
    config = tmp_path / "robot.toml"
    config.write_text("[web]\nhold = 0\n")
    assert f"{config}: [web] hold = 0 must be a positive number" in usage_error(f"--config={config}")


@pytest.mark.parametrize("text", ["", "  \n", "two words", "é", "one read\none", "# none", "one read,move"])
def test_a_token_file_that_cannot_be_used_is_named(tmp_path, text):
    token = tmp_path / "token"
    token.write_text(text)
    said = usage_error(f"--token-file={token}")
    assert str(token) in said
    assert "words" not in said  # it may be a secret


@pytest.mark.parametrize("arguments", [["-r", "nonsense"], ["--bogus"], ["--enclave", "no path"]])
def test_arguments_that_ros_does_not_take_are_named(arguments):
    assert arguments[-1] in usage_error("--ros-args", *arguments)


@pytest.mark.parametrize("option", ["--rest-port=70000", "--domain-id=102", "--time-scale=0", "--config=/nowhere"])
def test_options_out_of_range_are_refused(option):
    assert option.split("=", maxsplit=1)[0] in usage_error(option)


def test_both_interfaces_ask_for_the_token(domain_id, tmp_path):
    file = tmp_path / "token"
    file.write_text("s3cret\n")
    right = {"Authorization": "Bearer s3cret"}
    with running_robot(domain_id, f"--token-file={file}", "--attach") as served:
        urls = [served.rest + "/robot/pose/", served.rest + "/openapi.json", served.publishers + "?wsdl"]
        for url in urls:
            for headers in ({}, {"Authorization": "Bearer wrong"}, {"Authorization": "Basic s3cret"}):
                refused = served.client.get(url, headers=headers)
                assert refused.status_code == 401
                assert refused.headers["WWW-Authenticate"].startswith("Bearer ")
        assert served.call("PUT", delivery_path()).status_code == 401
        assert served.soap(delivery_envelope()).status_code == 401
        assert served.call("GET", "/openapi.json", headers=right).status_code == 200
        assert served.client.get(served.publishers + "?wsdl", headers=right).status_code == 200
        assert served.call("GET", "/robot/app/delivery/", headers={"Authorization": "bearer s3cret"}).json() == []


def test_the_simulated_robot_behind_the_web(domain_id):
    """From the web to the simulation and back: sensors, plan, goal, mission, and the states of deliveries."""
    with running_robot(domain_id, "--time-scale=20") as served:
        sensors = {(entry["name"], entry["type"]) for entry in served.call("GET", "/robot/sensors/").json()}
        assert ("scan", "sensor_msgs/msg/LaserScan") in sensors
        services = served.call("GET", "/robot/navigation/services/").json()
        assert services == [{"name": "/get_plan", "type": "nav_msgs/srv/GetPlan"}]
        plan = served.call("GET", "/robot/navigation/service/plan?x=76.02&y=41.35&yaw=1").json()["plan"]
        assert plan["header"]["frame_id"] == "map"
        assert plan["poses"][-1]["pose"]["position"]["x"] == pytest.approx(76.02, abs=0.1)
        assert served.call("GET", "/robot/navigation/service/plan?x=0&y=0").status_code == 422

        outside = served.call("PUT", "/robot/navigation/action/goal/", json=goal(x=-500.0))
        assert "outside the map" in problem(outside, 422)

        assert served.call("PUT", "/robot/velocity/", json=twist(x=0.4)).status_code == 200
        eventually(lambda: abs(served.call("GET", "/robot/velocity/").json()["linear"]["x"] - 0.4) < 0.02)
        eventually(lambda: served.call("GET", "/robot/velocity/").json()["linear"]["x"] == 0.0)

        assert served.call("PUT", delivery_path()).status_code == 204
        assert served.soap(delivery_envelope(message_code=3)).status_code == 200
        mission = eventually(
            lambda: (a := served.call("GET", "/robot/navigation/action/goal/")).is_success and a.json()
        )
        # To the source; or, so much faster than time, to the destination already.
        assert mission["goal"]["target_pose"]["pose"]["position"]["x"] in {76.02, 60.633}
        eventually(lambda: served.call("PUT", "/robot/velocity/", json=twist()).status_code == 409)
        states = eventually(lambda: [entry["state"] for entry in served.call("GET", "/robot/app/delivery/").json()])
        assert states in (["queued", "active"], ["queued", "queued"])
        eventually(lambda: served.call("GET", "/robot/app/delivery/").json()[1]["state"] == "done")
        eventually(lambda: served.call("GET", "/robot/navigation/action/goal/").is_success)
        assert served.call("DELETE", "/robot/navigation/action/goal/").status_code == 204
        assert served.call("GET", "/robot/navigation/action/goal/").status_code == 404
        eventually(lambda: served.call("GET", "/robot/app/delivery/").json()[0]["state"] == "failed")
