"""The player does as told on a real graph: two processes of it talk to each other."""

import base64
import math
import time

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool
from test_msgs.action import Fibonacci

from ros_probe.process import ProbeError, RosProcess

FIBONACCI = "test_msgs/action/Fibonacci"


class Player(RosProcess):
    def __init__(self, domain_id, name):
        super().__init__(name, domain_id=domain_id)
        self.await_ready()

    def heard(self, name, count=1):
        return self.tell("heard", name=name, count=count, within_s=15)["events"]


@pytest.fixture
def players(domain_id):
    made = [Player(domain_id, name) for name in ("robot", "other")]
    yield made
    for one in made:
        one.close()


def _matched(publisher, listener, topic, kind):
    listener.tell("listen", topic=topic, type=kind)
    for _ in range(500):
        if publisher.tell("publish", topic=topic, type=kind, gap_s=0)["subscribers"]:
            return
        publisher.tell("heard", name="none", count=1, within_s=0.02)
    raise AssertionError("nobody subscribed")


def test_values_of_each_primitive_type_arrive_to_the_bit_in_order(players):
    robot, other = players
    kind = "test_msgs/msg/UnboundedSequences"
    _matched(robot, other, "/values", kind)
    value = {
        "int64_values": [-(2**63), 2**53 + 1, 2**63 - 1],
        "uint64_values": [2**64 - 1],
        "float64_values": [math.nan, math.inf, -math.inf, -0.0, 5e-324, 0.1],
        "float32_values": [3.4028234663852886e38, 1.401298464324817e-45],
        "string_values": ["", "Zürich 🤖"],
        "bool_values": [True, False],
        "byte_values": {"b64": "AH//"},
        "uint8_values": {"b64": "AAECgP8="},
        "basic_types_values": [{"int64_value": 2**62 + 1}],
    }
    sent = robot.tell("publish", topic="/values", type=kind, values=[value, {}, value])["sent"]
    first, empty, last = other.heard("/values", 3)
    assert sent[0] < first[0] < last[0]
    for name, wanted in value.items():
        found = first[2][name]
        if name == "basic_types_values":
            assert found[0]["int64_value"] == 2**62 + 1
        else:
            assert repr(found) == repr(wanted), name
    assert empty[2]["int64_values"] == []


def test_a_latched_message_is_older_than_its_readers(players):
    robot, other = players
    latched = {"topic": "/map", "type": "std_msgs/msg/String", "durability": "transient_local", "apart": True}
    other.tell("listen", topic="/map", type=latched["type"])
    assert robot.tell("publish", **latched, values=[{"data": "first"}])["subscribers"] == 0
    _matched(robot, other, "/map", latched["type"])
    robot.tell("publish", **latched, values=[{"data": "second"}])
    # The player listens without latching, so the first message is none of those that it gets.
    assert [value["data"] for _, _, value in other.heard("/map")] == ["second"]
    robot.tell("forget", name="/map")
    for _ in range(500):
        # The node that is left may not have discovered the other's subscription yet.
        if robot.tell("graph")["topics"].get("/map", {}).get("subscribers") == 1:
            return
        robot.tell("heard", name="none", count=1, within_s=0.02)
    raise AssertionError(robot.tell("graph")["topics"])


def test_a_large_image_arrives(players):
    robot, other = players
    kind = "sensor_msgs/msg/Image"
    _matched(robot, other, "/image", kind)
    data = base64.b64encode(bytes(range(256)) * 4096).decode()
    robot.tell("publish", topic="/image", type=kind, values=[{"width": 1024, "data": {"b64": data}}])
    assert other.heard("/image")[0][2]["data"] == {"b64": data}


def test_a_killed_player_leaves_the_graph_and_what_is_no_type_is_told(players, domain_id):
    robot, other = players
    assert "geometry_msgs/Vector3" in robot.tell("describe", type="geometry_msgs/msg/Twist")["types"]
    for kind, said in (("nope_msgs/msg/A", "apt install ros-jazzy-nope-msgs"), ("std_msgs/msg/A", "has no msg 'A'")):
        with pytest.raises(ProbeError, match=said):
            robot.tell("describe", type=kind)
    with pytest.raises(ProbeError, match="no field 'y'"):
        robot.tell("publish", topic="/a", type="std_msgs/msg/Int8", values=[{"y": 1}])
    with pytest.raises(ProbeError, match="not understood: 'dance'"):
        robot.tell("dance")
    robot.tell("publish", topic="/here", type="std_msgs/msg/Int8")
    for _ in range(500):
        if "/here" in other.tell("graph")["topics"]:
            break
        other.tell("heard", name="none", count=1, within_s=0.02)
    assert other.tell("graph")["topics"]["/here"] == {"types": ["std_msgs/msg/Int8"], "publishers": 1, "subscribers": 0}
    robot.kill()
    with pytest.raises(ProbeError, match="has ended"):
        robot.tell("graph")
    again = Player(domain_id, "robot")
    again.tell("publish", topic="/here", type="std_msgs/msg/Int8", values=[{"data": 3}])
    again.close()


@pytest.fixture
def client(domain_id):
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    node = Node("client", context=context, start_parameter_services=False, enable_rosout=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def done(future):
        executor.spin_until_future_complete(future, 20)
        return future.result()

    yield node, done
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def test_a_service_follows_its_script(players, client):
    robot, (node, done) = players[0], client
    script = [{"answer": {"success": True, "message": "é"}}, {"delay_s": 0.2}, {"never": True}]
    robot.tell("serve", service="/reset", type="std_srvs/srv/SetBool", script=script)
    caller = node.create_client(SetBool, "/reset")
    assert caller.wait_for_service(20)
    assert done(caller.call_async(SetBool.Request(data=True))) == SetBool.Response(success=True, message="é")
    assert done(caller.call_async(SetBool.Request())) == SetBool.Response()
    never = caller.call_async(SetBool.Request())
    events = robot.heard("/reset", 5)
    assert [what for _, what, _ in events] == ["request", "response"] * 2 + ["request"]
    assert events[0][2] == {"data": True}
    assert not never.done()
    # A response that comes when its service is destroyed ends no other: rclpy raises in the thread of all callbacks.
    robot.tell("script", name="/reset", script=[{"delay_s": 0.1}])
    caller.call_async(SetBool.Request())
    assert [what for _, what, _ in robot.heard("/reset", 1)] == ["request"]
    robot.tell("forget", name="/reset")
    robot.tell("serve", service="/reset", type="std_srvs/srv/SetBool", script=[{}])
    assert "response" in [what for _, what, _ in robot.heard("/reset", 1)]
    assert caller.wait_for_service(20)
    for _ in range(2):
        assert done(caller.call_async(SetBool.Request())) == SetBool.Response()


def test_an_action_follows_its_script(players, client):
    robot, (node, done), executor = players[0], client, client[0].executor
    feedback = [{"sequence": [0]}, {"sequence": [0, 1]}]
    script = [
        {"reject": True},
        {"feedback": feedback, "result": {"sequence": [0, 1, 1]}},
        {"end": "abort"},
        {"end": "never", "refuse_cancel": True},
        {"end": "never"},
    ]
    robot.tell("act", action="/count", type=FIBONACCI, script=script)
    caller = ActionClient(node, Fibonacci, "/count")
    assert caller.wait_for_server(20)
    heard = []

    def came(said):
        heard.append(list(said.feedback.sequence))

    def goal():
        return done(
            caller.send_goal_async(Fibonacci.Goal(order=3), lambda said: heard.append(list(said.feedback.sequence)))
        )

    assert not goal().accepted
    accepted, deadline = goal(), time.monotonic() + 20
    while len(heard) < len(feedback) and time.monotonic() < deadline:  # a client with the result drops later feedback
        executor.spin_once(0.2)
    result = done(accepted.get_result_async())
    assert (result.status, list(result.result.sequence), heard) == (
        GoalStatus.STATUS_SUCCEEDED,
        [0, 1, 1],
        [[0], [0, 1]],
    )
    assert done(goal().get_result_async()).status == GoalStatus.STATUS_ABORTED
    stubborn = goal()
    assert not done(stubborn.cancel_goal_async()).goals_canceling
    last = goal()
    assert done(last.cancel_goal_async()).goals_canceling
    assert done(last.get_result_async()).status == GoalStatus.STATUS_CANCELED
    kinds = [what for _, what, _ in robot.heard("/count", 12)]
    assert kinds[:7] == ["rejected", "goal", "feedback", "feedback", "end", "goal", "end"]
    assert kinds[-3:] == ["goal", "cancel", "end"]


def test_a_node_holds_parameters_and_refuses_others(players, client):
    robot, (node, done) = players[0], client
    octets = {"b64": base64.b64encode(b"\0\xff").decode()}
    values = {"speed": ["double", 0.5], "count": ["integer", 2**60 + 1], "key": ["byte_array", octets]}
    robot.tell("hold", node="/lab/base", values=values)
    caller = AsyncParameterClient(node, "/lab/base")
    assert caller.wait_for_services(20)
    read = done(caller.get_parameters(["count", "key"])).values
    assert (read[0].integer_value, list(read[1].byte_array_value)) == (2**60 + 1, [b"\0", b"\xff"])
    taken, strange = done(caller.set_parameters([Parameter("speed", value=0.7), Parameter("count", value="x")])).results
    assert (taken.successful, strange.successful) == (True, False)
    robot.tell("hold", node="/lab/base", values={"key": ["byte_array", {"b64": ""}]}, refuses=True)
    assert not done(caller.set_parameters([Parameter("speed", value=0.9)])).results[0].successful
    assert robot.tell("held", node="/lab/base")["values"] == {"speed": 0.7, "count": 2**60 + 1, "key": {"b64": ""}}
    assert [event[1:] for event in robot.heard("/lab/base", 2)] == [["set", {"speed": 0.7}], ["set", {"speed": 0.9}]]
    until = time.monotonic() + 20
    while "/lab/base" not in (shown := players[1].tell("parameters")["nodes"]):
        assert time.monotonic() < until, "the other node does not find it"
    told = shown["/lab/base"]
    assert {name: told[name] for name in values} == {
        "speed": ["double", 0.7], "count": ["integer", 2**60 + 1], "key": ["byte_array", {"b64": ""}]
    }  # fmt: skip
    robot.tell("forget", name="/lab/base")
    until = time.monotonic() + 20
    while "/lab/base" in players[1].tell("graph")["nodes"]:
        assert time.monotonic() < until, "the node stays on the graph"
        node.executor.spin_once(0.05)
