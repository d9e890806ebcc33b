"""Bad input is refused with a 4xx that names it, reaches no robot, and the next good request is answered."""

import json
from urllib.parse import unquote

import pytest
from web_messages import delivery_path, twist
from web_robot import ForeignRobot, Served, problem

VELOCITY = "/robot/velocity/"
GOOD = json.dumps(twist())

XML = "<Twist><linear><x>{}</x><y>0</y><z>0</z></linear><angular><x>0</x><y>0</y><z>0</z></angular></Twist>"


def refused(served: Served, foreign: ForeignRobot, answer, status: int) -> None:
    assert problem(answer, status)
    assert "Traceback" not in answer.text
    assert len(answer.content) < 2000
    # What comes next over ROS is the next good request: the bad one reached nobody.
    assert served.call("PUT", VELOCITY, json=twist(x=0.123)).status_code == 200
    assert foreign.next("velocity")["x"] == 0.123


BAD_PARTS = {
    "code": ["coffee", "4.0", "", "5", "0", "-4", "+0007", "4294967300", "9" * 5000],
    "depot_x": ["abc", ""],
    "depot_y": ["NaN", "%31e400"],
    "dest_x": ["Infinity", "-inf", "1e400", "NaN"],
    "dest_y": ["1e400", "-1E+999"],
    "source_x": ["1_0", "0x10", "1,5", "9" * 400],
    "source_y": ["1.", "%D9%A1", "1%20", "%00"],
}


@pytest.mark.parametrize(("name", "sent"), [(name, value) for name, values in BAD_PARTS.items() for value in values])
def test_deliveries_with_bad_values_are_422(served, foreign, name, sent):
    """The refusal names the part of the path, and repeats it as it was sent."""
    answer = served.call("PUT", delivery_path(**{name: sent}))
    refused(served, foreign, answer, 422)
    told = answer.json()["detail"]
    assert told.startswith(f"{name} must be ")
    assert f"not {ascii(unquote(sent))[:100]}" in told
    assert len(told) < 300
    assert served.call("PUT", delivery_path(source_x=0.5)).status_code == 204
    assert foreign.next("delivery")["source_x"] == "3fe0000000000000"


def test_two_large_doubles_are_no_infinity(served, foreign):
    assert served.call("PUT", delivery_path(source_x="1.7e308", source_y="1.7e308")).status_code == 204
    foreign.next("delivery")


@pytest.mark.parametrize("sent", ["1e400", "-1E+999", "2" * 309])
@pytest.mark.parametrize(("media_type", "document"), [("application/json", GOOD), ("application/xml", XML.format(0.1))])
def test_a_body_s_number_is_repeated_as_it_was_sent(served, foreign, media_type, document, sent):
    headers = {"Content-Type": media_type}
    answer = served.call("PUT", VELOCITY, content=document.replace("0.1", sent), headers=headers)
    refused(served, foreign, answer, 422)
    assert answer.json()["detail"].startswith("linear.x must be a finite number, not ")
    assert sent[:100] in answer.json()["detail"]
