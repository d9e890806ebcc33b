"""End to end, what was accepted arrives: at the delivery application and at whoever else listens."""

import http.client
import json
import threading
from urllib.parse import urlsplit

from mybot_delivery_app.msg import DeliveryRequestMsg
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from std_msgs.msg import String
from web_messages import delivery_path
from web_robot import eventually, running_robot

from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime

LAST = 12.5  # depot_x of what is sent last until the listener is there
REQUESTS = 1600  # of each number of connections; benchmarks/robot.py does it with 20,000


class Listener:
    """A second reader of the requests, and a reader of the application's reports."""

    def __init__(self, ros):
        self.heard, self.last = 0, None
        self.reports = []
        self.missions = {}
        topics, node = RosNames().topics, ros.create_node("listener")
        keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL)
        node.create_subscription(DeliveryRequestMsg, topics.delivery, self._hear, keep_all)
        told = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(String, topics.missions, lambda report: self._note(json.loads(report.data)), told)

    def _hear(self, message):
        self.heard += 1
        self.last = message.depot_x

    def _note(self, report):
        self.reports.append(report)
        self.missions |= {mission["number"]: mission for mission in report["missions"]}

    @property
    def taken(self):
        return self.reports[-1]["taken"] if self.reports else 0


def accepted(served, connections, each, **values):
    """Send deliveries on so many connections at once; return how many were accepted, the others being refused."""
    statuses = []

    def deliver():
        connection = http.client.HTTPConnection(urlsplit(served.rest).netloc, timeout=60)
        for _ in range(each):
            connection.request("PUT", delivery_path(**values))
            answer = connection.getresponse()
            answer.read()
            assert answer.status == 204 or (answer.status, answer.headers["Retry-After"]) == (503, "1")
            statuses.append(answer.status)
        connection.close()

    clients = [threading.Thread(target=deliver) for _ in range(connections)]
    for client in clients:
        client.start()
    for client in clients:
        client.join()
    assert len(statuses) == connections * each
    return statuses.count(204)


def test_every_accepted_request_is_taken_and_told_of(domain_id):
    with running_robot(domain_id) as served, RosRuntime(domain_id) as ros:
        listener = Listener(ros)
        ros.start()
        total = 0
        while not listener.heard:  # from its first message on it is connected
            total += accepted(served, 1, 1)
        # Whoever hears the last of those sent until then has heard all that it ever will: one writer keeps their order.
        total += accepted(served, 1, 1, depot_x=LAST)
        eventually(lambda: listener.last == LAST)
        eventually(lambda: listener.taken == total)
        before = total - listener.heard
        for connections in (1, 8, 32):
            sent = accepted(served, connections, REQUESTS // connections)
            assert sent > REQUESTS / 2
            total += sent
            eventually(lambda total=total: listener.heard >= total - before and listener.taken == total)
            assert listener.heard == total - before
        assert listener.reports[-1]["dropped"] >= total - 100
        listed = eventually(lambda: all_ended(served.call("GET", "/robot/app/delivery/").json()))
        assert {entry["state"] for entry in listed} == {"dropped"}
        assert {entry["reason"] for entry in listed} == {"the queue is full with 20 missions"}


def all_ended(listed):
    return all(entry["state"] != "queued" for entry in listed) and listed
