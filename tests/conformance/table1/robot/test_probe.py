import math
import sys
import time

import pytest
import rclpy
from geometry_msgs.msg import Twist
from mybot_delivery_app.msg import DeliveryRequestMsg
from processes import ended
from rclpy.context import Context
from rclpy.node import Node

from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.robot.probe import Probe, ProbeError
from conformance.packs.table1.robot.robot import Velocity
from conformance.papers_robot.statement import Ros
from conformance.transport.passage import Recorder

_SENT = Delivery(4, -0.0, 5e-324, 1.7976931348623157e308, 1 / 3, 76.02, -1e-300)


class Heard(Recorder):
    def __init__(self):
        self.seen = []

    def saw(self, eye, at_s, values):
        self.seen.append((eye, at_s, values))


def publisher_pair(domain_id: int):
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    node = Node("robot", context=context, start_parameter_services=False)
    deliveries = node.create_publisher(DeliveryRequestMsg, "/DeliveryRequestMsg/from_json", 10)
    return context, node, deliveries, node.create_publisher(Twist, "/cmd_vel", 10)


def awaited(ask):
    until = time.monotonic() + 10
    while time.monotonic() < until:
        found = ask()
        if found:
            return found
        time.sleep(0.02)
    return []


def test_the_probe_sees_each_message_bit_for_bit(domain_id):
    context, node, deliveries, velocities = publisher_pair(domain_id)
    heard = Heard()
    probe = Probe(Ros(domain_id=domain_id), heard)
    began = time.monotonic()
    try:
        probe.await_ready()
        both = (deliveries, velocities)
        assert awaited(lambda: all(one.get_subscription_count() for one in both))
        deliveries.publish(DeliveryRequestMsg(**_SENT._asdict()))
        twist = Twist()
        twist.linear.x, twist.angular.z = 0.1, -1 / 3
        velocities.publish(twist)
        (seen,) = awaited(probe.deliveries)
        assert seen.bits == _SENT.bits
        assert math.copysign(1, seen.depot_x) < 0
        assert awaited(probe.velocities) == [Velocity(linear_x=0.1, angular_z=-1 / 3)]
        assert probe.deliveries() == []
        assert [eye for eye, _, _ in heard.seen] == ["deliveries", "velocities"]
        assert all(began <= at_s <= time.monotonic() for _, at_s, _ in heard.seen)
        assert probe.topics()["/cmd_vel"] == ["geometry_msgs/msg/Twist"]
    finally:
        probe.close()
        node.destroy_node()
        context.try_shutdown()
    with pytest.raises(ProbeError):
        probe.deliveries()


def test_a_domain_without_a_robot_is_told(domain_id):
    with pytest.raises(ProbeError, match="no ROS node is found"):
        Probe(Ros(domain_id=domain_id), Recorder()).await_ready()


def test_the_suite_loads_no_ros():
    modules = "conformance.packs.table1.robot.probe, conformance.packs.table1.rules.equivalence.test_ros_graph"
    program = f"import sys, {modules}; print('rclpy' in sys.modules)"
    assert ended(sys.executable, "-c", program, check=True).stdout.strip() == "False"
