"""The life of a goal, seen by an action server of another process."""

import pytest
from lxml import etree
from web_messages import goal, query_envelope, twist
from web_robot import eventually, problem

PATH = "/robot/navigation/action/goal/"


def test_a_goal_is_sent_shown_and_cancelled(served, foreign):
    assert served.call("GET", PATH).status_code == 404
    answer = served.call("PUT", PATH, json=goal(x=3.5))
    assert (answer.status_code, answer.headers["Location"]) == (201, PATH)
    assert foreign.next("goal") == {"frame_id": "map", "x": 3.5, "w": 1.0}
    shown = served.call("GET", PATH).json()
    assert shown["goal_id"]["id"] == "one"
    assert shown["goal"]["target_pose"]["pose"] == goal(x=3.5)["goal"]["target_pose"]["pose"]
    assert shown["status"]["code"] in {1, 2}
    assert shown["header"]["frame_id"] == "map"
    soap = served.soap(query_envelope("GetGoal"), url=served.subscribers)
    assert etree.fromstring(soap.content).findtext(".//goal_id/id") == "one"
    assert served.call("DELETE", PATH).status_code == 204
    assert foreign.next("cancel") == {"x": 3.5}
    assert served.call("GET", PATH).status_code == 404
    assert served.call("DELETE", PATH).status_code == 404
    soap = served.soap(query_envelope("GetGoal"), url=served.subscribers)
    assert soap.status_code == 500
    assert etree.fromstring(soap.content).findtext(".//detail/last_goal/goal_id/id") == "one"


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


def test_a_repeat_is_a_no_op_and_another_pose_a_conflict(served, foreign):
    assert served.call("PUT", PATH, json=goal()).status_code == 201
    foreign.next("goal")
    assert served.call("PUT", PATH, json=goal()).status_code == 200
    assert "one" in problem(served.call("PUT", PATH, json=goal(x=9.0)), 409)
    assert foreign.heard_nothing()
    assert served.call("GET", PATH).json()["goal"]["target_pose"]["pose"]["position"]["x"] == 3.0


def test_another_goal_preempts(served, foreign):
    served.call("PUT", PATH, json=goal("first"))
    foreign.next("goal")
    assert served.call("PUT", PATH, json=goal("second", x=5.0)).status_code == 202
    assert foreign.next("goal")["x"] == 5.0
    assert served.call("GET", PATH).json()["goal_id"]["id"] == "second"


def test_a_goal_that_has_ended_is_not_current_and_its_id_starts_a_new_one(served, foreign):
    served.call("PUT", PATH, json=goal())
    foreign.next("goal")
    foreign.do(finish=True)
    eventually(lambda: served.call("GET", PATH).status_code == 404)
    assert served.call("PUT", PATH, json=goal()).status_code == 201
    foreign.next("goal")


def test_id_and_header_may_be_left_out(served, foreign):
    answer = served.call("PUT", PATH, json=goal(identity=None))
    assert answer.status_code == 201
    filled = answer.json()
    assert filled["goal_id"]["id"]
    assert filled["goal"]["target_pose"]["header"]["stamp"]["sec"] > 0
    foreign.next("goal")
    # What the robot shows can be sent again, but for the status that it adds.
    shown = served.call("GET", PATH).json()
    del shown["status"]
    assert served.call("PUT", PATH, json=shown).status_code == 200


@pytest.mark.parametrize("identity", ["x" * 255, "für 猫 🐈", " ", "\t\x01\x7f", "</id>"])
def test_any_id_comes_back_unchanged(served, foreign, identity):
    assert served.call("PUT", PATH, json=goal(identity)).status_code == 201
    foreign.next("goal")
    assert served.call("GET", PATH).json()["goal_id"]["id"] == identity
    for accept in ("application/xml", "text/plain"):
        assert served.call("GET", PATH, headers={"Accept": accept}).status_code == 200


@pytest.mark.parametrize(
    ("sent", "named"),
    [
        (goal(frame_id="mars"), "mars"),
        (goal(frame_id=""), "frame_id"),
        (goal(w=1.01), "1.01"),
        (goal(w=0.0), "orientation"),
        (goal(identity=""), "goal_id.id"),
        (goal(identity="x" * 256), "goal_id.id"),
        (goal() | {"status": {"code": 1, "text": ""}}, "status"),
        (goal() | {"header": {"stamp": {"sec": 0, "nanosec": 0}}}, "header.frame_id"),
        (goal() | {"header": {"stamp": {"sec": 2**31, "nanosec": 0}, "frame_id": "map"}}, "header.stamp.sec"),
        (goal() | {"header": {"stamp": {"sec": 0, "nanosec": -1}, "frame_id": "map"}}, "header.stamp.nanosec"),
        (goal() | {"header": {"stamp": {"sec": 4e10, "nanosec": 0}, "frame_id": "map"}}, "not 40000000000.0"),
        (goal(w=1.7e308, z=1.7e308), "must have length 1 within 0.001, not {'x': 0.0, 'y': 0.0, 'z': 1.7e+308,"),
        ({"goal_id": {"id": "x"}}, "goal"),
    ],
)
def test_a_goal_of_the_wrong_shape_or_value_is_refused(served, foreign, sent, named):
    assert named in problem(served.call("PUT", PATH, json=sent), 422)
    assert foreign.heard_nothing()


def test_a_goal_that_the_robot_refuses_is_422(served, foreign):
    problem(served.call("PUT", PATH, json=goal(x=1000.0)), 422)
    assert foreign.next("goal")["x"] == 1000.0
    assert served.call("GET", PATH).status_code == 404


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
