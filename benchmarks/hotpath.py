"""The path of a request without the network: how long each of its stages takes.

``python benchmarks/hotpath.py`` feeds bytes to the connection of an interface without a socket. It prints the time of
each stage in nanoseconds, the shortest of several rounds, because other load only adds time. The publish is once a stub
and once Fast DDS with one reader, in this process.
"""

import asyncio
import os
import time
from collections.abc import Callable
from typing import Any

from httptools import HttpRequestParser
from lxml import etree
from mybot_delivery_app.msg import DeliveryRequestMsg
from robot import DELIVERY, ENVELOPE

from reference_robot.deliveries import DeliveryRequest
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime
from reference_robot.webservices.http.admission import Admission
from reference_robot.webservices.http.authorization import Authorization
from reference_robot.webservices.http.connection import HttpConnection
from reference_robot.webservices.http.hosts import AllowedHosts
from reference_robot.webservices.http.messages import Request
from reference_robot.webservices.http.port import Limits, Port
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.representation.xml_input import KnownNames, parsed
from reference_robot.webservices.resources.delivery import Delivery
from reference_robot.webservices.rest import RestInterface
from reference_robot.webservices.robot.deliveries import Deliveries
from reference_robot.webservices.soap.envelope import operation_element
from reference_robot.webservices.soap.interface import SoapInterface
from reference_robot.webservices.soap.publishers import PATH, PublishersWebService

ROUNDS, CALLS = 7, 3000
PUT = f"PUT {DELIVERY} HTTP/1.1\r\nHost: robot\r\n\r\n".encode()
POST = (
    f"POST {PATH} HTTP/1.1\r\nHost: robot\r\nContent-Type: text/xml\r\n"
    f"Content-Length: {len(ENVELOPE)}\r\n\r\n{ENVELOPE}"
).encode()


class Nobody:
    """Stands for the nodes of publishers and subscribers: accepts everything, receives nothing."""

    def __init__(self) -> None:
        self.mission_reports: list[str] = []

    def delivery_is_served(self) -> bool:
        """Return True: deliveries are accepted."""
        return True

    def publish_delivery(self, _request: Any) -> bool:
        """Return True without publishing."""
        return True


class Wire:
    """Stands for a transport."""

    def write(self, _octets: bytes) -> None:
        """Discard the data."""

    def get_extra_info(self, _name: str) -> None:
        """Return None: there is no peer."""

    def set_write_buffer_limits(self, _high: int) -> None:
        """Do nothing: this transport has no buffer."""


class Callbacks:
    """Parser callbacks that do nothing."""


def interfaces(publishers: Any) -> tuple[RestInterface, SoapInterface]:
    """Return both interfaces with nothing but deliveries behind them."""
    deliveries = Deliveries(publishers, Nobody())
    everybody = Admission(Authorization(None), AllowedHosts(["robot"]))
    return (
        RestInterface([], Delivery(deliveries), everybody),
        SoapInterface([PublishersWebService(deliveries)], lambda _: "", everybody),
    )


def connection(interface: Any) -> HttpConnection:
    """Return a connection to an interface, on no socket."""
    made = HttpConnection(Port(interface, Limits(patience=10.0)))
    made.connection_made(Wire())
    return made


def nanoseconds(call: Callable[[], Any]) -> float:
    """Return the time of a call."""
    best = float("inf")
    for _ in range(ROUNDS):
        started = time.perf_counter_ns()
        for _ in range(CALLS):
            call()
        best = min(best, time.perf_counter_ns() - started)
    return best / CALLS


def found(node: RobotPublishersNode) -> None:
    """Wait until the reader is connected."""
    while not node.delivery_is_served():
        time.sleep(0.01)


async def main() -> None:
    """Print the stages of PUT and POST."""
    domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
    with RosRuntime(domain) as ros:
        node = RobotPublishersNode(ros, RosNames())
        topic = RosNames().topics.delivery
        ros.create_node("reader", apart=True).create_subscription(DeliveryRequestMsg, topic, lambda _: None, 10)
        ros.start()
        await asyncio.to_thread(found, node)
        stages = put_stages() | post_stages()
        message = DeliveryRequest(4, *[0.0] * 6)
        stages["publish: rclpy and Fast DDS"] = lambda: node.publish_delivery(message)
        rest, soap = map(connection, interfaces(node))
        stages["PUT, published"] = lambda: rest.data_received(PUT)
        stages["SOAP, published"] = lambda: soap.data_received(POST)
        for name, call in stages.items():
            print(f"{name:44} {nanoseconds(call):8,.0f} ns", flush=True)


def put_stages() -> dict[str, Callable[[], Any]]:
    """Return functions by name, one for each stage of a delivery PUT; none publishes a message."""
    interface, _ = interfaces(Nobody())
    parser = HttpRequestParser(Callbacks())
    request = Request("PUT", DELIVERY.encode(), {b"host": b"robot"}, keep_alive=True)
    whole = connection(interface)
    return {
        "PUT: httptools alone": lambda: parser.feed_data(PUT),
        "PUT: route, check, answer": lambda: interface.respond(request),
        "PUT, not published": lambda: whole.data_received(PUT),
    }


def post_stages() -> dict[str, Callable[[], Any]]:
    """Return functions by name, one for each stage of ExecuteDeliveryRequest; none publishes a message."""
    _, interface = interfaces(Nobody())
    body = ENVELOPE.encode()
    names = KnownNames()
    libxml = etree.XMLParser(encoding="utf-8", resolve_entities=False)
    service = PublishersWebService(Deliveries(Nobody(), Nobody()))
    root = parsed(body)
    element = operation_element(root)
    request = Request("POST", PATH.encode(), {b"host": b"robot", b"content-type": b"text/xml"}, keep_alive=True)
    request.body = body
    whole = connection(interface)
    return {
        "SOAP: libxml2 alone": lambda: etree.fromstring(body, libxml),
        "SOAP: are the names known": lambda: names.has_all(body),
        "SOAP: parse, all checks of XML": lambda: parsed(body),
        "SOAP: envelope": lambda: operation_element(root),
        "SOAP: XSD": lambda: service.description.require_valid(element),
        "SOAP: parse, check, answer": lambda: interface.respond(request),
        "SOAP, not published": lambda: whole.data_received(POST),
    }


if __name__ == "__main__":
    asyncio.run(main())
