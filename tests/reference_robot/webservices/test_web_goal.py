"""The life of a goal, seen by an action server of another process."""

import pytest
from lxml import etree
from web_messages import goal, twist
from web_robot import eventually

PATH = "/robot/navigation/action/goal/"


def _last_goal(served):
    answer = served.call("GET", PATH)
    return answer.status_code == 404 and answer.json().get("last_goal")


def test_without_a_goal_the_robot_tells_how_the_last_one_ended(served, foreign):
    for number, (end, status) in enumerate(
        [(lambda: foreign.do(finish=True), (4, "succeeded")), (lambda: served.call("DELETE", PATH), (5, "canceled"))]
    ):
        served.call("PUT", PATH, json=goal(f"goal {number}"))
        foreign.next("goal")
        end()
        last = eventually(lambda: _last_goal(served))
        assert (last["goal_id"]["id"], tuple(last["status"].values())) == (f"goal {number}", status)
    as_xml = etree.fromstring(served.call("GET", PATH, headers={"Accept": "application/xml"}).content)
    assert as_xml.findtext("{*}last_goal/{*}status/{*}text") == "canceled"


def test_another_goal_preempts(served, foreign):
    served.call("PUT", PATH, json=goal("first"))
    foreign.next("goal")
    assert served.call("PUT", PATH, json=goal("second", x=5.0)).status_code == 202
    assert foreign.next("goal")["x"] == 5.0
    assert served.call("GET", PATH).json()["goal_id"]["id"] == "second"


def told(identity: str) -> dict[str, object]:
    pose = goal(x=7.0)["goal"]["target_pose"] | {"header": {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": "map"}}
    return {"goal_id": identity, "status": 2, "pose": pose}


def test_a_mission_s_goal_is_shown_and_cancelled(served, foreign):
    foreign.do(current_goal=told("ab" * 16))
    shown = eventually(lambda: (answer := served.call("GET", PATH)).is_success and answer.json())
    assert shown["goal_id"] == {"stamp": {"sec": 5, "nanosec": 6}, "id": "ab" * 16}
    assert shown["goal"]["target_pose"]["pose"]["position"]["x"] == 7.0
    assert served.call("PUT", "/robot/velocity/", json=twist()).status_code == 409
    assert served.call("DELETE", PATH).status_code == 204
    assert served.call("GET", PATH).status_code == 404
    foreign.do(current_goal={})


def test_a_goal_of_ours_is_never_taken_for_a_mission_s(served, foreign):
    """The robot's word on its current goal may lag behind: here it stays with a goal that was displaced."""
    foreign.do(tell_next_goal_as=told(""))
    assert served.call("PUT", PATH, json=goal("first")).status_code == 201
    foreign.next("goal")
    assert served.call("PUT", PATH, json=goal("second", x=5.0)).status_code == 202
    foreign.next("goal")
    assert served.call("DELETE", PATH).status_code == 204
    assert served.call("GET", PATH).status_code == 404
    foreign.forget_until("cancel")
    foreign.do(current_goal={})


@pytest.mark.parametrize("report", ["", [], {"goal_id": "x"}, {"goal_id": "x", "status": "2", "pose": {}}, 7])
def test_a_report_amiss_is_no_goal(served, foreign, report):
    foreign.do(current_goal=report)
    foreign.do(odometry={"x": 4.0, "covariance": 0.0})
    eventually(lambda: served.call("GET", "/robot/velocity/").json()["linear"]["x"] == 0.4)
    assert served.call("GET", PATH).status_code == 404
    foreign.do(odometry={"x": 1.0, "covariance": 0.0})
