"""A web gateway of ROS 2 on Python's own HTTP server: `web_gateway.py PORT DOMAIN [FAULT,…]`; right, or with faults."""

import json
import math
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from test_msgs.msg import BasicTypes, UnboundedSequences

from ros_probe.values import message_of, plain

READS = {"/odom": Odometry, "/basic": BasicTypes, "/sequences": UnboundedSequences}
WRITES = {
    "/velocity": ("/cmd_vel", Twist, "geometry_msgs/msg/Twist"),
    "/set": ("/set", BasicTypes, "test_msgs/msg/BasicTypes"),
}
_NAMED = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
MAP = """
[ros]
non_finite = "string"
bytes = "base64"

[ros.operations]
"GET /odom" = { topic = "/odom", type = "nav_msgs/msg/Odometry", at = "/data", absent = [404], max_age_s = 3.0 }
"GET /basic" = { topic = "/basic", type = "test_msgs/msg/BasicTypes", at = "/data", absent = [404] }
"GET /sequences" = { topic = "/sequences", type = "test_msgs/msg/UnboundedSequences", at = "/data", absent = [404] }
"POST /velocity" = { publishes = "/cmd_vel", type = "geometry_msgs/msg/Twist", timeout_s = 2.0 }
"POST /set" = { publishes = "/set", type = "test_msgs/msg/BasicTypes", timeout_s = 2.0 }
"""


def _web(value, fault):
    """Return the web's value of a message's value."""
    if isinstance(value, dict):
        return value["b64"] if set(value) == {"b64"} else {name: _web(one, fault) for name, one in value.items()}
    if isinstance(value, list):
        return [_web(one, fault) for one in (value[:2] if "cut" in fault else value)]
    if isinstance(value, float) and not math.isfinite(value):
        return 0 if "nan-0" in fault else str(value).replace("inf", "Infinity").replace("nan", "NaN")
    if isinstance(value, float):
        return round(value, 6) if "rounded" in fault else value
    if isinstance(value, int) and not isinstance(value, bool) and "doubles" in fault:
        return int(float(value))
    return value.encode("ascii", "replace").decode() if isinstance(value, str) and "ascii" in fault else value


def _ros(value):
    """Return the value of a message for a web's value."""
    if isinstance(value, dict):
        return {name: _ros(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_ros(one) for one in value]
    return _NAMED.get(value, value) if isinstance(value, str) else value


def _typed(value, message):
    """Check that a value has the types of a message.

    Raises:
        ValueError: it has not.
    """
    fields = plain(message)
    if not isinstance(value, dict) or not value.keys() <= fields.keys():
        raise ValueError("fields")
    for name, one in value.items():
        own = fields[name]
        if isinstance(own, dict):
            _typed(one, getattr(message, name))
        else:
            right = (float, int) if isinstance(own, float) else type(own)
            if isinstance(own, bool) != isinstance(one, bool) or not isinstance(one, right):
                raise ValueError(name)


class Gateway(Node):
    def __init__(self, context, fault):
        super().__init__("gateway", context=context, start_parameter_services=False, enable_rosout=False)
        self.fault, self.last, self.before, self.count, self.held = fault, {}, {}, 0, []
        self.first = {}
        qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        for topic, kind in READS.items():
            self.create_subscription(kind, topic, lambda message, topic=topic: self.came(topic, message), qos)
        self.senders = {path: self.create_publisher(kind, topic, 10) for path, (topic, kind, _) in WRITES.items()}
        self.lock = threading.Lock()

    def came(self, topic, message):
        value = plain(message)
        if self.last.get(topic) != value:
            self.before[topic] = self.last.get(topic)
        self.last[topic] = value

    def read(self, path):
        self.count += 1
        if path not in self.last:
            return 404, {"detail": "no message yet"}
        goes_back = "back" in self.fault and self.count % 3 == 0 and self.before.get(path)
        value = self.before[path] if goes_back else self.last[path]
        if "frozen" in self.fault:
            value = self.first.setdefault(path, value)
        return 200, {"data": _web(value, self.fault)}

    def write(self, path, body):
        _, kind, name = WRITES[path]
        try:
            value = _ros(json.loads(body))
            _typed(value, kind())
            message = message_of(name, value)
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it
            if "refused-sends" in self.fault:
                self.senders[path].publish(kind())
            return 422, {"detail": str(error)[:100]}
        with self.lock:
            self.count += 1
            self.publish(path, message)
        return 202, {"published": True}

    def publish(self, path, message):
        fault = self.fault
        if "dropped" in fault and self.count % 4 == 0:
            return
        if "swapped" in fault and hasattr(message, "linear"):
            message.linear.x, message.angular.z = message.angular.z, message.linear.x
        if "reordered" in fault and self.count % 4 == 1:
            # It comes after the next one, or after a moment without one.
            self.held.append((path, message))
            threading.Timer(0.2, self.release).start()
            return
        self.senders[path].publish(message)
        if "doubled" in fault and self.count % 4 == 0:
            self.senders[path].publish(message)
        self.release()

    def release(self):
        while self.held:
            path, message = self.held.pop()
            self.senders[path].publish(message)


def openapi():
    any_object = {"application/json": {"schema": {"type": "object"}}}

    def answers(*statuses):
        return {str(one): {"description": "x", "content": any_object} for one in statuses}

    paths = {path: {"get": {"operationId": f"get{path[1:]}", "responses": answers(200, 404)}} for path in READS}
    for path in WRITES:
        body = {"required": True, "content": any_object}
        paths[path] = {"post": {"operationId": f"send{path[1:]}", "requestBody": body, "responses": answers(202, 422)}}
    return {"openapi": "3.1.0", "info": {"title": "Gateway", "version": "1"}, "paths": paths}


def main(port, domain, faults=""):
    fault = faults.split(",")
    context = Context()
    rclpy.init(args=[], context=context, domain_id=int(domain), signal_handler_options=SignalHandlerOptions.NO)
    node = Gateway(context, fault)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        disable_nagle_algorithm = True

        def answer(self, status, value):
            octets = json.dumps(value, ensure_ascii=False).encode()
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(octets)))
            self.end_headers()
            self.wfile.write(octets)

        def do_GET(self):
            if self.path == "/openapi.json":
                self.answer(200, openapi())
            else:
                self.answer(*(node.read(self.path) if self.path in READS else (404, {"detail": "nothing here"})))

        def do_POST(self):
            body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
            self.answer(*(node.write(self.path, body) if self.path in WRITES else (404, {"detail": "nothing here"})))

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", int(port)), Handler)
    sys.stdout.write(f"{server.server_address[1]}\n")
    sys.stdout.flush()
    server.serve_forever()


if __name__ == "__main__":
    main(*sys.argv[1:])
