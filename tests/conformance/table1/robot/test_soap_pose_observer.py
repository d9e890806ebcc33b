"""Poses over SOAP beside those over REST: one message under one stamp, and stamps that do not run backwards."""

import json

import pytest
from toy_messages import STILL, ZERO, odometry

from conformance.documents.writing import xml_bytes
from conformance.packs.table1.checkers.soap_poses import SoapPoses
from conformance.packs.table1.robot.robot import POSE
from conformance.packs.table1.robot.soap_services import NAMESPACE
from conformance.transport.exchange import Exchange, Request, Response

_FAST = STILL | {"linear": ZERO | {"x": 0.3}}
_ENVELOPE = (
    '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>'
    '<w:GetPoseResponse xmlns:w="{}">{}</w:GetPoseResponse></s:Body></s:Envelope>'
)


def found_in(*read):
    """What is found where these odometry messages are read, each over "rest" or "soap", one after another."""
    found, checker = [], SoapPoses(lambda path: f"http://r2{path}")
    for number, (over, message) in enumerate(read):
        if over == "rest":
            request, media_type, body = Request("GET", f"http://r2{POSE}"), "application/json", json.dumps(message)
        else:
            returned = xml_bytes(message, "return").decode().partition("?>")[2]
            request, media_type, body = (
                Request("POST", "http://r2/ws"),
                "text/xml",
                _ENVELOPE.format(NAMESPACE, returned),
            )
        answer = Response(200, (("Content-Type", media_type),), body.encode(), 1.0, received_s=float(number))
        found += checker(Exchange(request, answer))
    return [one.cause for one in found if not one.holds]


@pytest.mark.parametrize(
    ("read", "expected"),
    [
        ([("rest", odometry(2)), ("soap", odometry(2)), ("rest", odometry(2))], []),
        ([("rest", odometry(2)), ("soap", odometry(2, _FAST)), ("rest", odometry(2))], ["another message"]),
        ([("rest", odometry(2)), ("soap", odometry(1, _FAST)), ("rest", odometry(2))], []),  # SOAP is a message behind
        ([("rest", odometry(2)), ("soap", odometry(2, _FAST)), ("rest", odometry(3, _FAST))], []),
        ([("soap", odometry(2, _FAST)), ("rest", odometry(2))], []),
    ],
)
def test_a_message_is_the_same_over_both(read, expected):
    assert found_in(*read) == expected


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        ((10, 11, 12), []),
        ((10, 11, 10.9, 12, 11.9), []),  # two processes, of which one has newer odometry
        ((10, 2, 3), []),  # a clock that was put back
        ((10, 11, 2, 12, 2), ["stamp"]),
    ],
)
def test_stamps_do_not_run_backwards(stamps, expected):
    assert found_in(*(("soap", odometry(stamp)) for stamp in stamps)) == expected
