"""One accepted request is exactly one message, every double bit for bit the one that was sent."""

import struct

import pytest
from web_messages import delivery_envelope, delivery_path

from conformance.papers_robot.delivery import EXAMPLE

DOUBLES = ["0.1", "-0.0", "1e308", "-1.7976931348623157e308", "5e-324", "2.2250738585072011e-308", "+.5", "007", "1E+2"]


def as_bits(values: dict[str, float], code: int) -> dict[str, object]:
    return {name: struct.pack(">d", value).hex() for name, value in values.items()} | {"message_code": code}


@pytest.mark.parametrize("code", [3, 4])
def test_each_interface_publishes_the_paper_s_request_once(served, foreign, code):
    answer = served.call("PUT", delivery_path(code))
    assert (answer.status_code, answer.content) == (204, b"")
    assert foreign.next("delivery") == as_bits(EXAMPLE, code)
    answer = served.soap(delivery_envelope(message_code=code))
    assert answer.status_code == 200
    assert "ExecuteDeliveryRequestResponse" in answer.text
    assert foreign.next("delivery") == as_bits(EXAMPLE, code)
    assert foreign.heard_nothing()


def test_coffee_is_code_4_whatever_the_message_says(served, foreign):
    answer = served.soap(delivery_envelope("ExecuteCoffeeRequest", message_code=3))
    assert "ExecuteCoffeeRequestResponse" in answer.text
    assert foreign.next("delivery") == as_bits(EXAMPLE, 4)


@pytest.mark.parametrize("text", DOUBLES)
def test_doubles_arrive_bit_for_bit(served, foreign, text):
    values = EXAMPLE | {"source_x": float(text)}
    assert served.call("PUT", delivery_path(source_x=text)).status_code == 204
    assert foreign.next("delivery") == as_bits(values, 4)
    assert served.soap(delivery_envelope(source_x=text)).status_code == 200
    assert foreign.next("delivery") == as_bits(values, 4)


def test_percent_encoded_numbers_are_numbers(served, foreign):
    assert served.call("PUT", delivery_path("%34", source_x="1%65%2B2")).status_code == 204
    assert foreign.next("delivery") == as_bits(EXAMPLE | {"source_x": 100.0}, 4)


def test_a_body_on_the_put_is_ignored(served, foreign):
    content = {"content": b"\xff{", "headers": {"Content-Type": "image/png"}}
    assert served.call("PUT", delivery_path(), **content).status_code == 204
    assert foreign.next("delivery") == as_bits(EXAMPLE, 4)


def test_the_list_shows_what_was_accepted_newest_first(served, foreign):
    served.call("PUT", delivery_path(3, source_x=1.25))
    served.soap(delivery_envelope(source_x=2.5))
    foreign.next("delivery")
    foreign.next("delivery")
    newest, before, *_ = served.call("GET", "/robot/app/delivery/").json()
    assert newest["request"] == EXAMPLE | {"source_x": 2.5, "message_code": 4}
    assert before["request"] == EXAMPLE | {"source_x": 1.25, "message_code": 3}
    assert (newest["interface"], before["interface"]) == ("soap", "rest")
    assert newest["state"] == "queued"  # this robot tells nothing about its missions
    assert newest["accepted"]["sec"] >= before["accepted"]["sec"] > 1_600_000_000


def test_the_list_holds_the_last_50_and_is_bounded(served, foreign):
    for number in range(120):
        assert served.call("PUT", delivery_path(source_x=number)).status_code == 204
    for _ in range(120):
        foreign.next("delivery")
    listed = served.call("GET", "/robot/app/delivery/").json()
    assert 50 <= len(listed) <= 100
    assert [entry["request"]["source_x"] for entry in listed[:50]] == [float(119 - place) for place in range(50)]
