"""Plans of a robot that plans as Nav2 does, by an action; those of a GetPlan service are our simulated robot's."""

import math

import pytest
from lxml import etree
from web_messages import fault_of, query_envelope
from web_robot import ForeignRobot, eventually, problem, running_robot

PATH = "/robot/navigation/service/plan"


def test_a_planner_of_nav2_is_asked(domain_id):
    with ForeignRobot(domain_id, "Twist", "planner") as robot, running_robot(domain_id, "--attach") as served:
        robot.do(odometry={"x": 2.5, "covariance": 0.0})
        eventually(
            lambda: (
                (a := served.call("GET", "/robot/pose/")).is_success
                and a.json()["pose"]["pose"]["position"]["x"] == 2.5
            )
        )
        plan = eventually(
            lambda: (a := served.call("GET", PATH + "?x=1e+1&y=-2&yaw=1")).is_success and a.json()["plan"]
        )
        # Without a start, the planner takes its own.
        assert robot.next("plan") == {"use_start": False, "frame_id": "map"}
        start, end = (pose["pose"] for pose in plan["poses"])
        assert start["position"] == {"x": 0.0, "y": 0.0, "z": 0.0}
        assert end["position"] == {"x": 10.0, "y": -2.0, "z": 0.0}
        assert end["orientation"]["z"] == pytest.approx(math.sin(0.5))
        assert {pose["header"]["frame_id"] for pose in plan["poses"]} == {"map"}

        given = served.call("GET", PATH + "?x=1&y=1&start_x=4&start_y=5&start_yaw=0").json()["plan"]["poses"][0]["pose"]
        assert (given["position"], given["orientation"]["w"]) == ({"x": 4.0, "y": 5.0, "z": 0.0}, 1.0)
        assert robot.next("plan")["use_start"]
        # A part of the start that is left out is the robot's own.
        mixed = served.call("GET", PATH + "?x=1&y=1&start_y=5").json()["plan"]["poses"][0]["pose"]
        assert mixed["position"] == {"x": 2.5, "y": 5.0, "z": 0.0}

        assert "1000" in problem(served.call("GET", PATH + "?x=1000&y=1"), 422)
        problem(served.call("GET", PATH + "?x=1&y=1&frame_id=odom"), 422)  # this planner knows the map alone

        fault_of(served.soap(query_envelope("GetPlan", "<x>1000</x><y>1</y>"), url=served.subscribers))
        soap = served.soap(query_envelope("GetPlan", "<x>3</x><y>1</y>"), url=served.subscribers)
        xs = etree.fromstring(soap.content).findall(".//poses/pose/position/x")
        assert [float(x.text) for x in xs] == [0.0, 3.0]

        # From now on it is known how its odometry lies in the map: a quarter turn, at (100, 10).
        assert not served.call("GET", "/robot/health/").json()["localisation"]["available"]
        robot.do(transform=[100.0, 10.0, math.pi / 2])
        eventually(lambda: served.call("GET", "/robot/health/").json()["localisation"]["available"])
        own = served.call("GET", PATH + "?x=1&y=1&start_y=5").json()["plan"]["poses"][0]["pose"]
        assert own["position"] == {"x": pytest.approx(100.0), "y": 5.0, "z": 0.0}
        assert own["orientation"] == {"x": 0.0, "y": 0.0, "z": pytest.approx(0.5**0.5), "w": pytest.approx(0.5**0.5)}
        robot.forget()
        turned = served.call("GET", PATH + "?x=7&y=8&start_x=2.5&start_y=0&frame_id=odom").json()["plan"]
        assert robot.next("plan") == {"use_start": True, "frame_id": "map"}  # it was planned in the map
        assert turned["header"]["frame_id"] == "odom"
        for pose, (x, y) in zip(turned["poses"], [(2.5, 0.0), (7.0, 8.0)], strict=True):
            assert pose["header"]["frame_id"] == "odom"
            assert pose["pose"]["position"] == {"x": pytest.approx(x), "y": pytest.approx(y, abs=1e-9), "z": 0.0}
