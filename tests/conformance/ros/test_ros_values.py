"""Messages that are made for any type, and how they are compared with what the web has."""

import json
import math
from types import SimpleNamespace

import pytest
import test_msgs.msg
import toy_messages

from conformance.engine.robot_under_test import RobotUnderTest
from conformance.rules.ros_gateway.test_topics import order
from conformance.scenarios.ros.definition import Definition, put_at, shape_of, value_at
from conformance.scenarios.ros.gateway import Gateway
from conformance.scenarios.ros.robot import Heard
from conformance.scenarios.ros.samples import Kind, Maker
from conformance.scenarios.ros.topics import Burst, Sent
from conformance.scenarios.ros.web import changes, differences, document_for, document_of, equal
from conformance.statement.ros_map import Acts, Body, Publishes, RosMap
from conformance.transport.exchange import Exchange, Request, Response
from ros_probe.values import described, message_of, plain

TYPES = [f"test_msgs/msg/{name}" for name in dir(test_msgs.msg) if name[0].isupper()]
TYPES += ["nav_msgs/msg/Odometry", "sensor_msgs/msg/Image", "std_msgs/msg/String", "geometry_msgs/msg/Twist"]
MAPS = [
    RosMap({}, non_finite="string", integers="string", bytes="array"),
    RosMap({}, non_finite="null", integers="number", bytes="base64"),
    RosMap({}, non_finite="literal"),
]


@pytest.mark.parametrize("name", TYPES)
def test_each_sample_is_a_message_and_what_is_written_of_it_is_right(name):
    definition, body = Definition(name, described(name)), Body(at="/data")
    for sample in Maker(definition, 0).samples(12, large=0):
        whole = plain(message_of(name, sample.value))
        assert equal(whole, sample.value), list(changes(whole, sample.value))
        for ros in MAPS:
            octets = json.dumps(document_for(whole, definition, body, ros)).encode()
            assert differences(document_of(octets), whole, definition, body, ros) == [], sample.what


def test_the_same_seed_makes_the_same_messages_and_usual_ones_differ():
    definition = Definition("geometry_msgs/msg/Twist", described("geometry_msgs/msg/Twist"))
    one, other = (list(Maker(definition, 7).samples(8, large=10_000)) for _ in range(2))
    assert repr(one) == repr(other)
    maker = Maker(definition, 7, is_gentle=True)
    assert len({repr(maker.usual().value) for _ in range(200)}) == 200
    assert max(maker.usual().value["linear"].values()) <= 0.05
    assert sum(each.kind is Kind.NON_FINITE for each in one) == 3


BASIC = Definition("test_msgs/msg/BasicTypes", described("test_msgs/msg/BasicTypes"))
SEQUENCES = Definition("test_msgs/msg/UnboundedSequences", described("test_msgs/msg/UnboundedSequences"))


def _differs(field, own, text, ros, definition=BASIC):
    whole = plain(message_of(definition.root, {field: own}))
    right = document_for(whole, definition, Body(), ros)
    right.pop(field)
    octets = (json.dumps(right)[:-1] + f', "{field}": {text}}}').encode()
    return [(one.web, one.ros) for one in differences(document_of(octets), whole, definition, Body(), ros)]


OPEN = RosMap({})


@pytest.mark.parametrize(
    ("field", "own", "text", "ros", "is_right"),
    [
        ("int64_value", 2**53 + 1, "9007199254740993", OPEN, True),
        ("int64_value", 2**53 + 1, "9007199254740992", OPEN, False),
        ("int64_value", 2**53 + 1, '"9007199254740993"', OPEN, True),
        ("int64_value", 2**53 + 1, '"9007199254740993"', RosMap({}, integers="number"), False),
        ("int64_value", 5, "5", RosMap({}, integers="string"), False),
        ("int64_value", 5, "5.0", OPEN, True),
        ("int32_value", 5, '"5"', OPEN, False),
        ("int32_value", 1, "true", OPEN, False),
        ("bool_value", True, "1", OPEN, False),
        ("float64_value", 0.1, "0.1000000000000000055", OPEN, True),
        ("float64_value", 1 / 3, "0.333333333333333", OPEN, False),
        ("float64_value", 0.1, '"0.1"', OPEN, False),
        ("float64_value", -0.0, "0", OPEN, True),
        ("float64_value", 5e-324, "0", OPEN, False),
        ("float64_value", 1e300, "1e400", OPEN, False),
        ("float64_value", math.nan, "null", OPEN, True),
        ("float64_value", math.nan, '"nan"', OPEN, True),
        ("float64_value", math.nan, "0", OPEN, False),
        ("float64_value", math.nan, "null", RosMap({}, non_finite="string"), False),
        ("float64_value", math.nan, "0", RosMap({}, non_finite="null"), False),
        ("float64_value", -math.inf, '"-Infinity"', RosMap({}, non_finite="string"), True),
        ("float64_value", math.inf, '"-Infinity"', RosMap({}, non_finite="string"), False),
        ("float64_value", math.inf, "Infinity", RosMap({}, non_finite="literal"), True),
        ("float32_value", 0.10000000149011612, "0.1", OPEN, True),
        ("float32_value", 0.10000000149011612, "0.10000000149011612", OPEN, True),
        ("float32_value", 0.3333333432674408, "0.33333", OPEN, False),
    ],
)
def test_a_value_on_the_web_is_judged_by_its_digits(field, own, text, ros, is_right):
    assert (_differs(field, own, text, ros) == []) == is_right


@pytest.mark.parametrize(
    ("text", "form", "is_right"),
    [
        ('"AAH/"', None, True),
        ("[0, 1, 255]", None, True),
        ('"0001ff"', None, True),
        ("[0, 1, 255]", "base64", False),
        ('"AAH/"', "array", False),
        ('"AAH/AA=="', None, False),
        ("[0, 1]", None, False),
    ],
)
def test_octets_are_base64_or_an_array(text, form, is_right):
    found = _differs("uint8_values", {"b64": "AAH/"}, text, RosMap({}, bytes=form), SEQUENCES)
    assert (found == []) == is_right


def test_names_that_differ_are_mapped_both_ways():
    body, ros = Body(at="/v", fields={"/x": "/linear/x", "/turn": "/angular/z"}, body={"mode": 1}), RosMap({})
    definition = Definition("geometry_msgs/msg/Twist", described("geometry_msgs/msg/Twist"))
    whole = plain(message_of(definition.root, {"linear": {"x": 0.5}, "angular": {"z": 2.0}}))
    assert document_for(whole, definition, body, ros) == {"mode": 1, "v": {"x": 0.5, "turn": 2.0}}
    right = document_of(b'{"v": {"x": 0.5, "turn": 2}}')
    assert differences(right, whole, definition, body, ros) == []
    missing = differences(document_of(b'{"v": {"x": 0.5}}'), whole, definition, body, ros)
    assert [(one.at, one.web, one.ros) for one in missing] == [("/angular/z", "nothing", "2.0")]


def test_a_body_that_is_no_message_differs():
    ros, definition = RosMap({}), Definition("std_msgs/msg/String", described("std_msgs/msg/String"))
    for octets in (b"", b"nonsense", b"[]", b'{"data": 3}', b"<a/>", b"[" * 100_000):
        assert differences(document_of(octets), {"data": "x"}, definition, Body(), ros)
    soap = b"<s:Envelope xmlns:s='s'><s:Body><r><data>x</data></r></s:Body></s:Envelope>"
    assert differences(document_of(soap), {"data": "x"}, definition, Body(), ros) == []


def test_shapes_and_pointers():
    assert (shape_of("sequence<double, 3>").most, shape_of("double[36]").count) == (3, 36)
    assert shape_of("string<22>").longest == 22
    assert value_at(put_at({}, "/a/1/b", 3), "/a/1/b") == 3
    assert value_at({"a": 1}, "/a/b") is None


@pytest.mark.parametrize(
    ("sent", "heard", "holds"),
    [
        ("TFFT", "TFFT", []),
        ("TFF", "FTF", []),
        ("123", "123", [True] * 2),
        ("12", "21", [False]),
        ("123", "13", [True]),
    ],
)
def test_order_is_judged_by_messages_that_differ(sent, heard, holds):
    ros = RosMap({"POST /a": Publishes(publishes="/a", type="std_msgs/msg/Char")})
    values = [json.dumps({"data": ord(one)}) for one in sent]
    requests = tuple(Sent("POST /a", "/a", "a message", one, toy_messages.exchange(), accepted=True) for one in values)
    came = tuple(Heard(0.0, "message", json.dumps({"data": ord(one)})) for one in heard)
    trace = (Burst("POST /a", "messages in a row", requests, came),)
    assert [one.holds for one in order.judge(trace, ros)] == holds


@pytest.mark.parametrize(("ros", "status", "away"), [("", 503, True), ("play", 503, False), ("play", 502, True)])
def test_a_topic_without_a_message_is_no_lost_device(ros, status, away):
    def exchange(status):
        return Exchange(Request("GET", "http://robot/odom", ()), Response(status, (), b"", 1.0))

    robot = SimpleNamespace(run=SimpleNamespace(ros=ros), rest=SimpleNamespace(looked=[exchange(200)]))
    assert RobotUnderTest._is_of_gateway(robot, exchange(status)) is away  # noqa: SLF001 - needs no device


def test_the_id_of_a_goal_may_have_the_name_that_the_description_gives_it():
    gateway = SimpleNamespace(binding=SimpleNamespace(make=lambda call, _: call))
    location = Response(202, (("Location", "/arm/executions/g7"),), b"", 1.0)
    body = Acts(action="/a", type="test_msgs/action/Fibonacci", values={"app": "arm"})
    sent = Exchange(Request("POST", "http://robot/arm/executions", ()), location)
    template = "GET /{app}/executions/{execution}"
    assert Gateway.following(gateway, sent, body, template, {}) == "GET /arm/executions/g7"
