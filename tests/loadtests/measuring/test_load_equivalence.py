"""Whether both interfaces carry the same."""

import pytest

from loadtests.clients.endpoint import Endpoint
from loadtests.clients.payloads import CATALOGUE, rest_request, soap_request, variants
from loadtests.clients.robot import Robot
from loadtests.clients.wire import Request
from loadtests.measuring.preflight import pose_difference, request_difference, requests_difference

ROBOT_REST = Endpoint.parse("http://robot:7003")
ROBOT = Robot("http://robot:7003/base", "http://robot:5555/p", "http://robot:5555/s", token="t0ken")  # noqa: S106 - made up


@pytest.mark.parametrize("operation", sorted(CATALOGUE))
def test_both_interfaces_carry_the_same_request(operation):
    rest, soap = (ROBOT.requests(interface, operation, 1) for interface in ("rest", "soap"))
    assert len(rest) == len(soap) == 64
    assert requests_difference(operation, rest, soap) is None
    assert all(b"Authorization: Bearer t0ken\r\n" in request.octets for request in rest + soap)
    assert all(b" /base/robot/" in request.octets for request in rest)


def test_requests_that_differ_are_found():
    values = variants("delivery", 1)[0]
    rest = rest_request(ROBOT_REST, "delivery", values, None)
    other = soap_request(ROBOT_REST, "delivery", values | {"source_y": values["source_y"] + 1e-13}, None)
    assert "source_y" in request_difference("delivery", rest, other)
    code = soap_request(ROBOT_REST, "delivery", values | {"message_code": 4}, None)
    assert request_difference("delivery", rest, code) == "message_code is 3 over REST and 4.0 over SOAP"
    empty = Request(other.octets.replace(b"arg0", b"arg1"))
    assert request_difference("delivery", rest, empty) == "the SOAP request carries no arg0"


POSE = b'<S:Envelope xmlns:S="urn:s"><n:GetPoseResponse xmlns:n="http://soap.turtlebot.mybot.org/">%s</n:GetPoseResponse></S:Envelope>'


def test_a_pose_that_leaves_something_out_is_no_equal():
    assert pose_difference(b'{"x": 1}', POSE % b"<return><x>1</x></return>") is None
    assert pose_difference(b'{"x": 1, "y": 2}', POSE % b"<return><x>1</x></return>") == (
        "pose: 1 values of 'y' over REST and 0 over SOAP"
    )
    assert "cannot be read" in pose_difference(b"none", POSE % b"")
    assert "DOCTYPE" in pose_difference(b"{}", b"<!DOCTYPE x><x/>")
