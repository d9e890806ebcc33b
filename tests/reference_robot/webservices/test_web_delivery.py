"""One accepted request is exactly one message, every double bit for bit the one that was sent."""

import struct

import pytest
from web_messages import delivery_envelope, delivery_path

from conformance.papers_robot.delivery import EXAMPLE


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


def test_the_list_holds_the_last_50_and_is_bounded(served, foreign):
    for number in range(120):
        assert served.call("PUT", delivery_path(source_x=number)).status_code == 204
    for _ in range(120):
        foreign.next("delivery")
    listed = served.call("GET", "/robot/app/delivery/").json()
    assert 50 <= len(listed) <= 100
    assert [entry["request"]["source_x"] for entry in listed[:50]] == [float(119 - place) for place in range(50)]
