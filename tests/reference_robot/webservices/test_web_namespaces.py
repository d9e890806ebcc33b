"""Several robots on one graph: ROS's own arguments reach the nodes of the web services, and of the simulation."""

import pytest
from web_messages import delivery_path, twist
from web_robot import RosProcess, eventually, running_robot

from reference_robot.ending import divide_words
from reference_robot.ros import RosRuntime


@pytest.mark.parametrize(
    ("words", "own", "ros"),
    [
        (["--attach"], ["--attach"], []),
        (["--attach", "--ros-args", "-r", "a:=b"], ["--attach"], ["--ros-args", "-r", "a:=b"]),
        (["--ros-args", "-r", "a:=b", "--", "--attach"], ["--attach"], ["--ros-args", "-r", "a:=b", "--"]),
    ],
)
def test_ros_s_words_are_told_from_ours(words, own, ros):
    assert divide_words(words) == (own, ros)


def test_each_robot_is_served_in_its_namespace_by_its_clock_and_enclave(domain_id):
    local = ["-r", "/DeliveryRequestMsg/from_json:=DeliveryRequestMsg/from_json"]
    clock = ["-p", "use_sim_time:=true", "--enclave", "/fleet/one"]
    with (
        _base(domain_id, "one") as one,
        _base(domain_id, "two") as two,
        running_robot(domain_id, "--attach", "--ros-args", "-r", "__ns:=/one", *local, *clock) as served,
        running_robot(domain_id, "--time-scale=5", "--ros-args", "-r", "__ns:=/three", *local) as simulated,
        RosRuntime(domain_id) as ros,
    ):
        one.do(odometry=1.0, clock=1234)
        two.do(odometry=2.0)
        eventually(lambda: _x(served.call("GET", "/robot/pose/")) == 1.0)
        # Until the clock is heard it is zero, which is what a stamp says then.
        eventually(
            lambda: (
                served.call("PUT", "/robot/velocity/", json=twist(x=0.2)).is_success
                and one.next("velocity") == {"x": 0.2, "frame": "base_link", "sec": 1234}
            )
        )
        assert two.heard_nothing()
        graph = ros.create_node("observer")
        eventually(lambda: ("robot_publishers", "/one", "/fleet/one") in _nodes(graph))

        assert simulated.call("PUT", delivery_path()).status_code == 204
        assert served.call("PUT", delivery_path()).status_code == 503  # nobody delivers there
        topics = {entry["topic"] for entry in simulated.call("GET", "/robot/sensors/").json()}
        assert topics == {"/three/scan", "/three/imu", "/three/battery_state"}
        assert served.call("GET", "/robot/sensors/").json() == []
        services = simulated.call("GET", "/robot/navigation/services/").json()
        assert services == [{"name": "/three/get_plan", "type": "nav_msgs/srv/GetPlan"}]


def _base(domain_id, name):
    return RosProcess("nav2_nodes.py", str(domain_id), "base", "TwistStamped", "--ros-args", "-r", f"__ns:=/{name}")


def _x(pose):
    return pose.json()["pose"]["pose"]["position"]["x"] if pose.is_success else None


def _nodes(graph):
    return graph.get_node_names_and_namespaces_with_enclaves()
