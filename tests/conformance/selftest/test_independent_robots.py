"""What the lenient independent robot takes and refuses, and an independent robot as a process.

The other two are judged by the suite: in roaas selftest, and wherever a test certifies them.
"""

import http.client
import subprocess
import sys
from importlib import import_module
from types import MappingProxyType
from urllib.parse import urlsplit

import pytest
from lxml import etree

SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
TNS = "http://soap.turtlebot.mybot.org/"
DELIVERY = "/robot/app/delivery/{}/depot_x/68.269/depot_y/38.718/dest_x/60.633/dest_y/{}/source_x/76.02/source_y/41.35"


class Client:
    def __init__(self, rest, soap):
        self.rest, self.soap = urlsplit(rest), urlsplit(soap)

    def send(self, where, method, target, body=None, headers=MappingProxyType({})):
        connection = http.client.HTTPConnection(where.hostname, where.port, timeout=30)
        try:
            connection.request(method, target, body, headers)
            answer = connection.getresponse()
            return answer, answer.read()
        finally:
            connection.close()

    def call(self, operation, content=""):
        body = (
            f'<e:Envelope xmlns:e="{SOAP}"><e:Body><t:{operation} xmlns:t="{TNS}">{content}</t:{operation}>'
            "</e:Body></e:Envelope>"
        )
        answer, got = self.send(
            self.soap, "POST", "/turtlesim_publisher_ws", body, {"Content-Type": "text/xml", "SOAPAction": '""'}
        )
        return answer, etree.fromstring(got)


@pytest.fixture(scope="module")
def legacy():
    rest, soap, stop = import_module("proof.table1.independent_robots.legacy").serve(0, 0)
    yield Client(rest, soap)
    stop()


def body_of(envelope):
    assert envelope.tag == f"{{{SOAP}}}Envelope"
    (body,) = envelope.findall(f"{{{SOAP}}}Body")
    (child,) = body
    return child


def test_legacy_is_as_lenient_as_java(legacy):
    assert legacy.send(legacy.rest, "PUT", DELIVERY.format(7, "NaN"))[0].status == 204
    assert legacy.send(legacy.rest, "PUT", DELIVERY.format(3, "0x1p3"))[0].status == 204
    assert legacy.send(legacy.rest, "PUT", DELIVERY.format(3, "here"))[0].status == 404
    answer, envelope = legacy.call("ExecuteCoffeeRequest", "<arg0><depot_x>far</depot_x><other/></arg0>")
    assert (answer.status, body_of(envelope).tag) == (200, f"{{{TNS}}}ExecuteCoffeeRequestResponse")
    answer, envelope = legacy.call("Dance")
    assert (answer.status, body_of(envelope).findtext("faultcode")) == (500, "S:Client")
    assert (
        etree.fromstring(legacy.send(legacy.soap, "GET", "/turtlesim_publisher_ws?xsd=1")[1]).tag
        == "{http://www.w3.org/2001/XMLSchema}schema"
    )


def test_an_independent_robot_starts_and_stops_as_a_process():
    command = [sys.executable, "-m", "proof.table1.independent_robots", "legacy"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        assert line.startswith("ready rest=http://127.0.0.1:")
        assert line.rstrip().endswith("/turtlesim_publisher_ws?wsdl")
    finally:
        process.terminate()
    assert process.wait(60) == 0
