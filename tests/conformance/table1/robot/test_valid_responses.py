"""Every successful SOAP response of a run is judged by the XSD."""

import json
import re

import pytest
from toy_messages import STILL, ZERO, odometry

from conformance.api.soap.envelope import envelope
from conformance.api.soap.messages import ordinary
from conformance.api.soap.service import SoapService
from conformance.contract.classes import Interface
from conformance.documents.writing import xml_bytes
from conformance.documents.wsdl import read_file
from conformance.documents.xml import clark
from conformance.packs.table1.checkers.soap_responses import SoapPoses, SoapResponses
from conformance.packs.table1.robot.robot import POSE
from conformance.packs.table1.robot.soap_services import NAMESPACE
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import CheckerListener
from conformance.verdict.run import Run

_WSDL = CONTRACT_DIR / "subscribers.wsdl"
_URL = "http://robot:5555/turtlesim_subscriber_ws"
_POINT = "<x>{}</x><y>0.0</y><z>0.0</z>"
_VELOCITY = (
    '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>'
    '<t:GetVelocityResponse xmlns:t="http://soap.turtlebot.mybot.org/"><return>'
    f"<linear>{_POINT}</linear><angular>{_POINT.format('0.0')}</angular>"
    "</return></t:GetVelocityResponse></s:Body></s:Envelope>"
)


@pytest.mark.parametrize(
    ("body", "status", "refuted"),
    [
        (_VELOCITY.format("0.5"), 200, False),
        (_VELOCITY.format("0,5"), 200, True),
        (_VELOCITY.format("0.5").replace("<linear>", "<linear/><linear>"), 200, True),
        (_VELOCITY.format("0,5"), 500, False),
        (_VELOCITY.format("0.5").replace("<s:Body>", "<s:Body><a/>"), 200, True),
        (_VELOCITY.format("0.5").replace("soap.turtlebot", "soap.other"), 200, True),
        (_VELOCITY.format("0.5").replace("schemas.xmlsoap.org/soap/envelope/", "www.w3.org/2003/05/soap"), 200, True),
        (_VELOCITY.format("0.5").replace("t:GetVelocityResponse", "s:Fault"), 200, False),
        ("no XML", 200, False),
        ("", 200, True),
        ("", 202, False),
        ("", 413, False),
    ],
)
def test_an_invalid_response_is_found_whoever_asked(body, status, refuted):
    assert ("soap-subscribers/response-valid" in judged(body, status)) is refuted


def judged(body, status=200):
    """The requirements that a response breaks."""
    base, path = _URL.rsplit("/", 1)
    service = SoapService(Interface.SUBSCRIBERS, HttpClient(base, Connection()), f"/{path}", contract_wsdl_path=_WSDL)
    vars(service)["described"] = service.contract  # as a check has found it
    run = Run()
    response = Response(status, (("Content-Type", "text/xml"),), body.encode(), 1.0)
    exchange = Exchange(Request("POST", _URL, (), b"<a/>"), response)
    CheckerListener(run.judge, [SoapResponses([service])]).on_response(exchange)
    return set(run.judge.failure_counts())


_OPERATIONS = {
    "GetPose": "pose",
    "GetVelocity": "velocity",
    "GetGoal": "goal",
    "GetPlan": "plan",
    "GetSensors": "sensors",
    "GetNavigationServices": "sensors",  # which has the services as a part
}


def made(operation):
    """The text of an ordinary response, with a quaternion of length 1, a goal's status and full names."""
    described = read_file(_WSDL)
    wrapper = described.shape(clark(described.target_namespace, f"{operation}Response"))
    text = envelope([ordinary(wrapper, optional=True)]).serialize().decode()
    text = re.sub(r"<orientation>.*?</orientation>", f"<orientation>{_POINT.format('1')}<w>0</w></orientation>", text)
    text = re.sub(r"<code>[^<]*", "<code>1", text)
    kind = "nav_msgs/srv/GetPlan" if operation == "GetNavigationServices" else "sensor_msgs/msg/LaserScan"
    return re.sub(r"<type>[^<]*", f"<type>{kind}", text)


@pytest.mark.parametrize("operation", _OPERATIONS)
def test_what_the_schema_makes_is_complete(operation):
    assert judged(made(operation)) == set()


@pytest.mark.parametrize(
    ("operation", "old", "new"),
    [
        ("GetPose", "<orientation>.*?</orientation>", ""),
        ("GetPose", "(<orientation><x>)[^<]*", r"\g<1>3"),
        ("GetPose", "<covariance>[^<]*</covariance>", ""),
        ("GetVelocity", "(<x>)[^<]*", r"\1NaN"),
        ("GetVelocity", "(<x>)[^<]*", r"\1<y/>"),
        ("GetVelocity", "(<angular>.*?</angular>)", r"\1\1"),
        ("GetPose", "(<nanosec>)[^<]*", r"\g<1>4294967296"),
        ("GetPose", "(<sec>)[^<]*", r"\g<1>1.5"),
        ("GetSensors", "(<return>.*</return>)", r"\1\1"),
        ("GetSensors", "sensor_msgs/msg/", "sensor_msgs/"),
        ("GetNavigationServices", "<name>[^<]*</name>", ""),
        ("GetPlan", "<poses>.*</poses>", ""),
        ("GetGoal", "<pose>.*</pose>", ""),
    ],
)
def test_what_is_incomplete_is_found(operation, old, new):
    spoiled = re.sub(old, new, made(operation), count=1, flags=re.DOTALL)
    assert spoiled != made(operation)
    assert f"soap-subscribers/{_OPERATIONS[operation]}" in judged(spoiled)


@pytest.mark.parametrize(
    ("operation", "old", "new"),
    [
        ("GetVelocity", "(<angular>)", r"<own>1</own>\1"),
        ("GetPose", "((<covariance>[^<]*</covariance>){36})", r"<covariance>\1</covariance>"),
        ("GetGoal", "<return>.*</return>", ""),
    ],
)
def test_what_the_contract_leaves_open_is_complete(operation, old, new):
    laid_out = re.sub(old, new, made(operation), count=1, flags=re.DOTALL)
    assert laid_out != made(operation)
    assert judged(laid_out) <= {"soap-subscribers/response-valid"}


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
