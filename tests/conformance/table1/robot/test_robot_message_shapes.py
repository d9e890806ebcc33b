import copy
import json

import pytest
from toy_messages import STILL, odometry

from conformance.documents.representation import projected
from conformance.packs.table1.robot.message_shapes import ODOMETRY, SENSORS, TWIST, read_as
from conformance.transport.exchange import Response


def answer(body: bytes, status: int = 200) -> Response:
    return Response(status, (("Content-Type", "application/json"),), body, 1.0)


def test_a_complete_message_has_no_fault_whatever_a_robot_adds_to_it():
    message = copy.deepcopy(odometry()) | {"battery": 0.5}
    message["pose"]["pose"]["position"] = {"x": 0, "y": 1.5, "z": -2e3, "w": None}
    assert ODOMETRY.problem(message) == ""
    assert "battery" not in projected(message, ODOMETRY.schema)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda m: m.pop("child_frame_id"), "child_frame_id is missing"),
        (lambda m: m["pose"].update(covariance=[0] * 35), "pose.covariance has 35 items"),
        (lambda m: m["pose"]["covariance"].__setitem__(7, "0"), 'pose.covariance[7] is "0", not of type number'),
        (lambda m: m["twist"]["twist"]["linear"].update(x=True), "twist.twist.linear.x is true"),
        (lambda m: m["twist"]["twist"]["linear"].update(x=10**400), "twist.twist.linear.x is"),
        (lambda m: m["header"].update(stamp=5), "header.stamp is 5, not of type object"),
        (lambda m: m["header"]["stamp"].update(nanosec=-1), "header.stamp.nanosec: -1 is less than the minimum of 0"),
        (lambda m: m.update(pose=[]), "pose is [], not of type object"),
    ],
)
def test_a_fault_is_told_by_the_offending_field(change, told):
    message = copy.deepcopy(odometry())
    change(message)
    assert ODOMETRY.problem(message).startswith(told)


@pytest.mark.parametrize("value", [None, 5, "text", {}, [1], [{"name": ""}], [{"name": "a", "topic": "b", "type": 5}]])
def test_what_is_no_list_of_sensors_has_a_fault(value):
    assert SENSORS.problem(value)


@pytest.mark.parametrize(
    "body", [b"", b"{", b'{"linear": NaN}', b"\xff\xfe", b"[" * 100_000, b'{"a": Infinity}', b"<Twist/>", b"1" * 5000]
)
def test_hostile_bodies_are_told_and_never_raised(body):
    value, problem = read_as(answer(body), TWIST)
    assert value is None
    assert problem


def test_another_status_is_no_message():
    assert read_as(answer(json.dumps(STILL).encode(), 500), TWIST) == (None, "status 500")
    assert read_as(answer(json.dumps(STILL).encode()), TWIST) == (STILL, "")
