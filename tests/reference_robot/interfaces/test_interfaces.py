"""The interface packages: their definitions, and messages that cross processes bit for bit."""

import random
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest
from lxml import etree
from mybot_delivery_app.msg import DeliveryRequestMsg
from nav2_msgs.action import ComputePathToPose, NavigateToPose
from rclpy.impl.implementation_singleton import rclpy_implementation as rclpy_c
from rclpy.serialization import serialize_message
from tf2_msgs.msg import TFMessage

import reference_robot
from conformance.papers_robot.delivery import COFFEE, COORDINATES, COURIER, MESSAGE_FIELDS
from reference_robot.deliveries import DeliveryRequest
from reference_robot.ros import RosRuntime

INTERFACES = Path(reference_robot.__file__).with_name("interfaces")

# Another process: writes each message that it gets as hexadecimal, code first.
LISTENER = """
import struct, sys, threading
from mybot_delivery_app.msg import DeliveryRequestMsg
from reference_robot.ros import RosRuntime

wanted, ended = int(sys.argv[1]), threading.Event()
got = []

def take(message):
    doubles = [getattr(message, name) for name in sys.argv[2:]]
    got.append(struct.pack(">i6d", message.message_code, *doubles).hex())
    if len(got) == wanted:
        ended.set()

with RosRuntime() as ros:
    ros.create_node("listener").create_subscription(DeliveryRequestMsg, "/DeliveryRequestMsg/from_json", take, 1000)
    ros.start()
    ended.wait(200)
print("\\n".join(got))
"""


def requests():
    tiny, huge = 5e-324, sys.float_info.max
    yield 4, (68.269, 38.718, 60.633, 37.51, 76.02, 41.35)  # the paper's example
    yield -(2**31), (-0.0, 0.0, tiny, -tiny, huge, -huge)
    yield 2**31 - 1, (0.1 + 0.2, 1 / 3, 2.0**-1022, sys.float_info.epsilon, 1e308, -1e-308)
    chance = random.Random(20)  # noqa: S311 - the same doubles in every run
    for _ in range(200):
        doubles = [0.0] * 6
        for place in range(6):
            bits = chance.getrandbits(64)
            while (bits >> 52) & 0x7FF == 0x7FF:  # infinities and NaN
                bits = chance.getrandbits(64)
            (doubles[place],) = struct.unpack(">d", bits.to_bytes(8))
        yield chance.randrange(-(2**31), 2**31), tuple(doubles)


def test_delivery_requests_reach_another_process_bit_for_bit(domain_id):
    sent = list(requests())
    with (
        subprocess.Popen(
            [sys.executable, "-c", LISTENER, str(len(sent)), *COORDINATES], stdout=subprocess.PIPE, text=True
        ) as listener,
        RosRuntime(domain_id) as ros,
    ):
        publisher = ros.create_node("sender").create_publisher(
            DeliveryRequestMsg, "/DeliveryRequestMsg/from_json", 1000
        )
        ros.start()
        deadline = time.monotonic() + 30
        while not publisher.get_subscription_count():
            assert time.monotonic() < deadline
            time.sleep(0.01)
        for number, (code, doubles) in enumerate(sent):
            fields = dict(zip(COORDINATES, doubles, strict=True))
            message = DeliveryRequestMsg(message_code=code, **fields)
            publisher.publish(message if number % 2 else DeliveryRequest(code, *doubles).serialize())
        received, _ = listener.communicate(timeout=240)
    assert received.split() == [struct.pack(">i6d", code, *doubles).hex() for code, doubles in sent]


def test_octets_of_any_sender_are_read_as_they_were_meant():
    for code, doubles in requests():
        request = DeliveryRequest(code, *doubles)
        fields = dict(zip(COORDINATES, doubles, strict=True))
        octets = [
            request.serialize(),
            serialize_message(DeliveryRequestMsg(message_code=code, **fields)),
            struct.pack("<4si4x6d", b"\x00\x01\x00\x03", code, *doubles),  # the options' octets may say anything
            struct.pack(">4si4x6d", b"\x00\x00\x00\x00", code, *doubles),  # big endian
        ]
        for each in octets:
            assert DeliveryRequest.of(each).serialize() == request.serialize()


@pytest.mark.parametrize("octets", [b"", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + bytes(55)])
def test_octets_that_are_no_message_are_refused(octets):
    with pytest.raises(rclpy_c.RMWError):
        DeliveryRequest.of(octets)


def test_the_delivery_request_has_the_papers_fields():
    assert DeliveryRequestMsg.get_fields_and_field_types() == {
        "message_code": "int32",
        **dict.fromkeys(COORDINATES, "double"),
    }
    assert DeliveryRequest._fields == MESSAGE_FIELDS
    assert DeliveryRequestMsg.COURIER_DELIVERY_MESSAGE_CODE == COURIER == 3
    assert DeliveryRequestMsg.COFFEE_DELIVERY_MESSAGE_CODE == COFFEE == 4


TIMES = "builtin_interfaces/Duration navigation_time, builtin_interfaces/Duration estimated_time_remaining"


@pytest.mark.parametrize(
    ("message", "definition"),
    [
        (NavigateToPose.Goal, "geometry_msgs/PoseStamped pose, string behavior_tree"),
        (NavigateToPose.Result, "uint16 error_code, string error_msg"),
        (
            NavigateToPose.Feedback,
            "geometry_msgs/PoseStamped current_pose, int16 number_of_recoveries, float distance_remaining, " + TIMES,
        ),
        (
            ComputePathToPose.Goal,
            "geometry_msgs/PoseStamped goal, geometry_msgs/PoseStamped start, string planner_id, boolean use_start",
        ),
        (
            ComputePathToPose.Result,
            "nav_msgs/Path path, builtin_interfaces/Duration planning_time, uint16 error_code, string error_msg",
        ),
        (TFMessage, "sequence<geometry_msgs/TransformStamped> transforms"),
    ],
)
def test_the_actions_are_nav2s_and_transforms_tf2s(message, definition):
    fields = message.get_fields_and_field_types()
    assert {f"{kind} {name}" for name, kind in fields.items()} == set(definition.split(", "))
    assert NavigateToPose.Result.NONE == ComputePathToPose.Result.NONE == 0


@pytest.mark.parametrize("name", ["mybot_delivery_app", "nav2_msgs", "tf2_msgs"])
def test_a_package_is_what_colcon_expects(name):
    folder = INTERFACES / name
    manifest = etree.parse(folder / "package.xml")
    assert (manifest.getroot().get("format"), manifest.findtext("name")) == ("3", name)
    assert manifest.findtext("export/build_type") == "ament_cmake"
    assert manifest.findtext("member_of_group") == "rosidl_interface_packages"
    cmake = (folder / "CMakeLists.txt").read_text()
    assert f"project({name})" in cmake
    definitions = [path.relative_to(folder).as_posix() for path in folder.glob("*/*.[ma]*")]
    assert definitions
    for definition in definitions:
        assert f'"{definition}"' in cmake
    assert "wheels" not in cmake  # what pip needs beyond colcon stays out of it
