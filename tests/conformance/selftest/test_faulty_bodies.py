"""Faults in the body of a robot: each can be started, and the suite sees them over real HTTP."""

import json

import pytest

from conformance.contract.pack import Contract
from conformance.packs.table1.robot.message_shapes import ODOMETRY
from proof.selftest.certifying import job_at, run_job
from proof.selftest.robots import running
from proof.table1.faulty_bodies import FAULTY_BODIES
from proof.table1.independent_robots.baroque import BUILD
from proof.table1.independent_robots.body import Body, pose
from proof.table1.selftest import with_fault


@pytest.mark.parametrize("name", FAULTY_BODIES)
def test_a_faulty_body_is_asked_like_a_good_one(name):
    kind = FAULTY_BODIES[name]
    body = kind(BUILD, yields=True)
    assert isinstance(body, Body)
    assert kind is not Body
    assert body.drive(0.1, 0.2) == 0.2
    assert set(body.velocity()) == {"linear", "angular"}
    assert not ODOMETRY.problem(body.odometry())
    x, y, yaw = BUILD.start
    goal, new = body.send("one", pose(x + 1, y, yaw), "map")
    assert new
    assert goal.id == "one"
    assert body.path((x, y, yaw), x + 1, y, yaw)
    assert body.cancel()
    body.deliver("rest", message_code=3, depot_x=1.5)
    assert body.deliveries[0].interface == "rest"


@pytest.mark.parametrize(("fault", "fails"), [("delivery-single-precision", True), ("", False)])
def test_a_fault_inside_a_robot_is_seen_from_outside(fault, fails, tmp_path):
    requirement, on_ros = "equivalence/delivery-rest", "equivalence/sensors-graph"
    with running(Contract.load(), with_fault(fault)) as robot:
        outcome = run_job(job_at(robot, requirements=(requirement, on_ros), timeout_s=60.0, out=tmp_path))
    assert outcome.verdicts[requirement] == ("fail" if fails else "pass"), outcome.reasons
    # The robot's own list is all that shows what arrived, and the result says so.
    assert json.loads((tmp_path / "result.json").read_text())["class_views"]["equivalence"] == "black box"
