"""A refusal names the field as the interface does by which it came, and repeats the value as it was sent."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from lxml import etree
from web_messages import delivery_envelope, delivery_path, goal, query_envelope, twist

if TYPE_CHECKING:
    from web_robot import Served

VELOCITY = "/robot/velocity/"
PLAN = "/robot/navigation/service/plan"
TWIST = "<Twist><linear><x>{}</x><y>0</y><z>0</z></linear><angular><x>0</x><y>0</y><z>0</z></angular></Twist>"


def detail(answer) -> str:
    assert answer.status_code == 422, answer.text
    return answer.json()["detail"]


def faultstring(answer) -> str:
    assert answer.status_code == 500, answer.text
    return etree.fromstring(answer.content).findtext(".//faultstring")


@pytest.mark.parametrize(
    ("given", "named", "sent"),
    [
        ({"dest_x": "1e400"}, "dest_x", "'1e400'"),
        ({"dest_y": "-1E+999"}, "dest_y", "'-1E+999'"),
        ({"source_x": "9" * 400}, "source_x", "'9999999"),
        ({"depot_y": "%31e400"}, "depot_y", "'1e400'"),
        ({"dest_x": "NaN"}, "dest_x", "'NaN'"),
        ({"code": "5"}, "code", "'5'"),
        ({"code": "+0007"}, "code", "'+0007'"),
        ({"code": "coffee"}, "code", "'coffee'"),
    ],
)
def test_rest_names_the_part_of_the_path(served: Served, given: dict[str, str], named: str, sent: str):
    told = detail(served.call("PUT", delivery_path(**given)))
    assert told.startswith(f"{named} must be ")
    assert f"not {sent}" in told
    assert len(told) < 300


@pytest.mark.parametrize(
    ("given", "named", "sent"),
    [
        ({"destination_x": "1e400"}, "destination_x", "'1e400'"),
        ({"destination_y": "-INF"}, "destination_y", "'-INF'"),
        ({"source_y": "NaN"}, "source_y", "'NaN'"),
        ({"depot_x": "9" * 400}, "depot_x", "'9999999"),
        ({"message_code": "+05"}, "message_code", "'+05'"),
        ({"message_code": "0" * 5000 + "4"}, "message_code", "'0000000"),
    ],
)
def test_soap_names_the_element_of_the_message(served: Served, given: dict[str, str], named: str, sent: str):
    told = faultstring(served.soap(delivery_envelope(**given)))
    assert told.startswith(f"{named} must be ")
    assert f"not {sent}" in told
    assert len(told) < 300


def test_soap_repeats_what_a_plan_was_asked_for(served: Served):
    for sent in ("1e400", "9" * 400):
        told = faultstring(served.soap(query_envelope("GetPlan", f"<x>{sent}</x><y>1</y>"), url=served.subscribers))
        assert told.startswith(f"x must be finite, not '{sent[:5]}")
        assert len(told) < 300


@pytest.mark.parametrize(
    ("query", "sent"),
    [("x=1&y=1e400", "'1e400'"), ("x=1&y=%2B1E999", "'+1E999'"), ("x=1&y=1&yaw=-Infinity", "'-Infinity'")],
)
def test_a_query_is_repeated_as_it_was_sent(served: Served, query: str, sent: str):
    assert detail(served.call("GET", f"{PLAN}?{query}")).endswith(f"not {sent}")


@pytest.mark.parametrize("sent", ["1e400", "-1E+999", "2" * 309])
@pytest.mark.parametrize("media_type", ["application/json", "application/xml"])
def test_a_body_s_number_is_repeated_as_it_was_sent(served: Served, media_type: str, sent: str):
    body = json.dumps(twist()).replace("0.1", sent) if media_type == "application/json" else TWIST.format(sent)
    told = detail(served.call("PUT", VELOCITY, content=body, headers={"Content-Type": media_type}))
    assert told.startswith("linear.x must be a finite number, not ")
    assert sent[:100] in told


def test_a_body_s_integer_is_repeated_as_it_was_sent(served: Served):
    body = json.dumps(goal() | {"header": {"stamp": {"sec": 4e10, "nanosec": 0}, "frame_id": "map"}})
    told = detail(
        served.call("PUT", "/robot/navigation/action/goal/", content=body, headers={"Content-Type": "application/json"})
    )
    assert told.endswith("not 40000000000.0")


def test_a_quaternion_beyond_all_lengths_is_repeated_as_it_was_sent(served: Served):
    sent = goal(w=1.7e308)
    sent["goal"]["target_pose"]["pose"]["orientation"]["z"] = 1.7e308
    told = detail(served.call("PUT", "/robot/navigation/action/goal/", json=sent))
    assert told.startswith("goal.target_pose.pose.orientation must have length 1")
    assert "1.7e+308" in told
    assert "inf" not in told
