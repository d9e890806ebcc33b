"""What ROS publishes is what both interfaces show, in every format."""

from web_messages import fault_of, query_envelope
from web_robot import ForeignRobot, Served, eventually, problem, running_robot

PATH = "/robot/pose/"


def published(served: Served, foreign: ForeignRobot, x: float) -> None:
    foreign.do(odometry={"x": x, "covariance": 1e-05})
    eventually(lambda: served.call("GET", PATH).json()["pose"]["pose"]["position"]["x"] == x)


def test_odometry_of_a_foreign_node_is_the_pose(served, foreign):
    published(served, foreign, 0.1)
    pose = served.call("GET", PATH).json()
    assert list(pose) == ["header", "child_frame_id", "pose", "twist"]
    assert (pose["header"]["frame_id"], pose["child_frame_id"]) == ("odom", "base_link")
    assert (pose["pose"]["covariance"], len(pose["twist"]["covariance"])) == ([0.0] * 35 + [1e-05], 36)
    later = eventually(lambda: (new := served.call("GET", PATH).json())["header"] != pose["header"] and new)
    assert later["header"]["stamp"] != pose["header"]["stamp"]


def test_before_the_first_odometry_there_is_503(domain_id):
    with ForeignRobot(domain_id, "Twist", "silent") as silent, running_robot(domain_id, "--attach") as served:
        for path in (PATH, "/robot/velocity/", "/robot/velocity/linear/"):
            problem(served.call("GET", path), 503)
        assert fault_of(served.soap(query_envelope("GetPose"), url=served.subscribers)) == "Server"
        silent.do(odometry={"x": 2.0, "covariance": 0.0})
        eventually(lambda: served.call("GET", PATH).status_code == 200)
        # A value that is not finite never leaves.
        silent.do(odometry={"x": 2.0, "covariance": float("nan")})
        refused = eventually(lambda: (a := served.call("GET", PATH)).status_code == 503 and a)
        assert "covariance[35] is nan" in refused.json()["detail"]
        assert fault_of(served.soap(query_envelope("GetPose"), url=served.subscribers)) == "Server"
        silent.do(odometry={"x": float("inf"), "covariance": 0.0})
        refused = eventually(lambda: (a := served.call("GET", "/robot/velocity/")).status_code == 503 and a)
        assert "linear.x is inf" in refused.json()["detail"]
