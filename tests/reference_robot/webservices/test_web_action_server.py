"""The action server alone goes and comes back: its node, and all else of the robot, stays where it is."""

from collections.abc import Iterator

import pytest
from web_messages import goal
from web_robot import RosProcess, Served, eventually, problem, running_robot

GOAL, HEALTH, POSE = "/robot/navigation/action/goal/", "/robot/health/", "/robot/pose/"
PLAN = "/robot/navigation/service/plan?x=1&y=2"


@pytest.fixture
def navigator(domain_id: int) -> Iterator[RosProcess]:
    process = RosProcess("nav2_nodes.py", str(domain_id), "navigator")
    yield process
    process.kill()  # a goal of a server that is gone is driven for ever


@pytest.fixture
def attached(domain_id: int) -> Iterator[Served]:
    with RosProcess("nav2_nodes.py", str(domain_id), "base"), running_robot(domain_id, "--attach") as served:
        yield served


def test_an_action_server_that_goes_is_503_and_one_that_comes_back_is_found(attached, navigator):
    eventually(lambda: attached.call("GET", HEALTH).json()["navigation"] == {"available": True, "state": "active"})
    eventually(lambda: attached.call("GET", PLAN).status_code == 200)
    assert attached.call("PUT", GOAL, json=goal("first", x=5.0)).status_code == 201
    assert navigator.next("goal") == 5.0
    for turn in range(2):
        navigator.do(server=False)
        assert navigator.next("server") is False
        eventually(lambda: attached.call("GET", GOAL).status_code == 404)  # nobody follows it any more
        refused = eventually(
            lambda turn=turn: (
                (a := attached.call("PUT", GOAL, json=goal(f"early {turn}", x=6.0))).status_code == 503 and a
            )
        )
        problem(refused, 503)
        assert attached.call("DELETE", GOAL).status_code == 404
        health = attached.call("GET", HEALTH).json()
        assert health["navigation"]["available"] is False
        # The rest of the robot is there.
        assert health["planner"]["available"]
        eventually(lambda: attached.call("GET", POSE).status_code == 200)
        assert attached.call("GET", PLAN).status_code == 200
        assert navigator.heard_nothing()

        navigator.do(server=True)
        assert navigator.next("server") is True
        eventually(lambda: attached.call("GET", HEALTH).json()["navigation"] == {"available": True, "state": "active"})
        again = f"again {turn}"
        # Until both ends know each other, a server may take a goal and be unable to tell its client: 202, and no goal.
        eventually(lambda again=again: attached.call("PUT", GOAL, json=goal(again, x=7.0)).status_code in {200, 201})
        navigator.forget_until("goal")
        navigator.forget()
        eventually(lambda: attached.call("GET", GOAL).is_success)
        assert attached.call("GET", GOAL).json()["goal_id"]["id"] == again
    assert attached.call("DELETE", GOAL).status_code == 204
    navigator.forget_until("cancel")
    assert attached.call("GET", GOAL).status_code == 404
