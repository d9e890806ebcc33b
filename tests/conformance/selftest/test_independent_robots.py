"""The independent robots keep the contract: shown by direct assertions, not by the suite that is tested with them."""

import http.client
import itertools
import json
import math
import subprocess
import sys
import time
from importlib import import_module
from urllib.parse import urlsplit

import pytest
import yaml
from lxml import etree

SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
TNS = "http://soap.turtlebot.mybot.org/"
DELIVERY = "/robot/app/delivery/{}/depot_x/68.269/depot_y/38.718/dest_x/60.633/dest_y/{}/source_x/76.02/source_y/41.35"
STILL = {"linear": {"x": 0, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0}}
MESSAGE = (
    "<arg0><depot_x>1</depot_x><depot_y>2</depot_y><destination_x>3</destination_x><destination_y>4</destination_y>"
    "<message_code>{}</message_code><source_x>5</source_x><source_y>6.25</source_y></arg0>"
)


class Client:
    def __init__(self, rest, soap):
        self.rest, self.soap = urlsplit(rest), urlsplit(soap)

    def send(self, where, method, target, body, headers):
        connection = http.client.HTTPConnection(where.hostname, where.port, timeout=30)
        try:
            connection.request(method, target, body, headers)
            answer = connection.getresponse()
            return answer, answer.read()
        finally:
            connection.close()

    def ask(self, method, target, value=None, **headers):
        body = None if value is None else json.dumps(value)
        sent = {"Content-Type": "application/json"} if value is not None else {}
        return self.send(self.rest, method, target, body, sent | headers)

    def call(self, operation, content="", service="publisher"):
        body = (
            f'<e:Envelope xmlns:e="{SOAP}"><e:Body><t:{operation} xmlns:t="{TNS}">{content}</t:{operation}>'
            "</e:Body></e:Envelope>"
        )
        answer, got = self.send(
            self.soap, "POST", f"/turtlesim_{service}_ws", body, {"Content-Type": "text/xml", "SOAPAction": '""'}
        )
        return answer, etree.fromstring(got)

    def describe(self, query, service="publisher"):
        return self.send(self.soap, "GET", f"/turtlesim_{service}_ws?{query}", None, {})


@pytest.fixture(scope="module", params=["plain", "baroque"])
def robot(request):
    rest, soap, stop = import_module(f"proof.table1.independent_robots.{request.param}").serve(0, 0)
    client = Client(rest, soap)
    client.name = request.param
    yield client
    stop()


@pytest.fixture(scope="module")
def legacy():
    rest, soap, stop = import_module("proof.table1.independent_robots.legacy").serve(0, 0)
    yield Client(rest, soap)
    stop()


def until(holds, seconds=30.0):
    ends = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < ends, "it did not come to that in time"
        time.sleep(0.02)


def body_of(envelope):
    assert envelope.tag == f"{{{SOAP}}}Envelope"
    (body,) = envelope.findall(f"{{{SOAP}}}Body")
    (child,) = body
    return child


def test_pose_is_a_whole_odometry_with_a_stamp_that_advances(robot):
    first = json.loads(robot.ask("GET", "/robot/pose/")[1])
    assert len(first["pose"]["covariance"]) == len(first["twist"]["covariance"]) == 36
    assert math.isclose(sum(part**2 for part in first["pose"]["pose"]["orientation"].values()), 1, abs_tol=1e-6)
    until(lambda: json.loads(robot.ask("GET", "/robot/pose/")[1])["header"]["stamp"] != first["header"]["stamp"])


def test_formats_carry_the_same(robot):
    sensors = json.loads(robot.ask("GET", "/robot/sensors/")[1])
    answer, text = robot.ask("GET", "/robot/sensors/", Accept="text/plain;q=0.9, application/json;q=0.1")
    assert answer.headers.get_content_type() == "text/plain"
    assert next(yaml.safe_load_all(text)) == sensors
    answer, xml = robot.ask("GET", "/robot/sensors/", Accept="application/xml")
    assert [node.text for node in etree.fromstring(xml).iter("topic")] == [sensor["topic"] for sensor in sensors]
    assert "accept" in answer.headers["Vary"].lower()
    assert robot.ask("GET", "/robot/sensors/", Accept="image/png")[0].status == 406


def test_velocity_is_reached_and_ends_by_itself(robot):
    def speed():
        return json.loads(robot.ask("GET", "/robot/velocity/")[1])["linear"]["x"]

    answer, _ = robot.ask("PUT", "/robot/velocity/", {**STILL, "linear": {"x": 0.2, "y": 0, "z": 0}})
    assert answer.status in {200, 204}
    until(lambda: math.isclose(speed(), 0.2))
    until(lambda: speed() == 0)


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"{", {400}),
        (b'{"linear": {"x": NaN}}', {400}),
        (json.dumps({"linear": STILL["linear"]}).encode(), {422}),
        (json.dumps({**STILL, "speed": 1}).encode(), {422}),
        (json.dumps(STILL).replace('"y": 0', '"y": 0, "y": 0').encode(), {400, 422}),
        (json.dumps({**STILL, "linear": {"x": 99, "y": 0, "z": 0}}).encode(), {422}),
        (json.dumps({**STILL, "linear": {"x": 0, "y": 0.1, "z": 0}}).encode(), {422}),
        (json.dumps({**STILL, "linear": {"x": 0, "y": 0, "z": "0"}}).encode(), {422}),
    ],
)
def test_invalid_velocities_are_refused_by_a_problem(robot, body, status):
    answer, got = robot.send(robot.rest, "PUT", "/robot/velocity/", body, {"Content-Type": "application/json"})
    assert answer.status in status
    assert answer.headers.get_content_type() == "application/problem+json"
    assert json.loads(got)["status"] == answer.status


def goal(x, y, id_=None):
    pose = {"position": {"x": x, "y": y, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    value = {"goal": {"target_pose": {"header": {"frame_id": "map"}, "pose": pose}}}
    return value if id_ is None else value | {"goal_id": {"id": id_}}


def test_life_of_a_goal(robot):
    target = "/robot/navigation/action/goal/"
    assert robot.ask("GET", target)[0].status == 404
    assert robot.ask("PUT", target, goal(1, 1, "a"))[0].status in {201, 202}
    assert robot.ask("PUT", target, goal(1, 1, "a"))[0].status in {200, 202, 204}
    assert robot.ask("PUT", target, goal(2, 1, "a"))[0].status == 409
    assert robot.ask("PUT", target, goal(2, 1, "b"))[0].status in {201, 202}
    assert json.loads(robot.ask("GET", target)[1])["goal_id"]["id"] == "b"
    assert robot.ask("DELETE", target)[0].status == 204
    assert robot.ask("GET", target)[0].status == 404


def test_plan_leads_from_the_robot_to_the_place(robot):
    _, got = robot.ask("GET", "/robot/navigation/service/plan?x=0.5&y=1.5&start_x=0&start_y=0")
    poses = json.loads(got)["plan"]["poses"]
    places = [(pose["pose"]["position"]["x"], pose["pose"]["position"]["y"]) for pose in poses]
    assert (places[0], places[-1]) == ((0, 0), (0.5, 1.5))
    assert max(math.dist(one, other) for one, other in itertools.pairwise(places)) < 0.2
    assert robot.ask("GET", "/robot/navigation/service/plan?x=1e9&y=0")[0].status == 422
    assert robot.ask("GET", "/robot/navigation/service/plan?x=here&y=0")[0].status in {400, 422}


def test_deliveries_are_taken_with_their_codes(robot):
    assert robot.ask("PUT", DELIVERY.format(4, "37.51"))[0].status in {200, 204}
    for wrong in (
        DELIVERY.format(5, 1),
        DELIVERY.format(3, "NaN"),
        DELIVERY.format(3, "here"),
        DELIVERY.format(3, "1e400"),
    ):
        assert robot.ask("PUT", wrong)[0].status in {400, 422}


def test_methods_and_paths(robot):
    answer, _ = robot.ask("POST", "/robot/pose/")
    assert answer.status == 405
    assert "GET" in answer.headers["Allow"]
    assert robot.ask("OPTIONS", "/robot/pose/")[0].headers["Allow"]
    assert robot.ask("HEAD", "/robot/pose/")[1] == b""
    assert robot.ask("GET", "/robot/nothing/")[0].status == 404
    assert robot.ask("GET", "/robot/pose")[0].status in {301, 307, 308, 404}


def test_soap_operations_answer_with_their_wrappers(robot):
    for operation in ("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"):
        answer, envelope = robot.call(operation, MESSAGE.format(3))
        assert answer.status == 200
        assert body_of(envelope).tag == f"{{{TNS}}}{operation}Response"
    _, envelope = robot.call("GetPose", service="subscriber")
    (value,) = body_of(envelope).findall("return")
    assert len(value.findall("pose/covariance")) == 36
    _, envelope = robot.call("GetPlan", "<x>0.5</x><y>1</y>", service="subscriber")
    assert float(body_of(envelope).findall("return/plan/poses")[-1].findtext("pose/position/y")) == 1


@pytest.mark.parametrize(
    "content",
    [
        "",
        MESSAGE.format(7),
        MESSAGE.format("x"),
        MESSAGE.format(2**31),
        MESSAGE.format(3).replace("6.25", "INF"),
        MESSAGE.format(3).replace("<depot_x>1</depot_x>", ""),
        MESSAGE.format(3).replace("depot_x", "depot_q"),
    ],
)
def test_soap_faults_are_client_faults_with_500(robot, content):
    answer, envelope = robot.call("ExecuteDeliveryRequest", content)
    fault = body_of(envelope)
    assert (answer.status, fault.tag) == (500, f"{{{SOAP}}}Fault")
    assert fault.findtext("faultcode").strip().endswith(":Client")
    assert fault.findtext("faultstring")


def test_entities_are_refused(robot):
    bomb = '<!DOCTYPE e [<!ENTITY a "3">]>'
    body = f'{bomb}<e:Envelope xmlns:e="{SOAP}"><e:Body/></e:Envelope>'
    answer, _ = robot.send(robot.soap, "POST", "/turtlesim_publisher_ws", body, {"Content-Type": "text/xml"})
    assert answer.status == 500


def test_descriptions_are_served(robot):
    for service in ("publisher", "subscriber"):
        answer, wsdl = robot.describe("wsdl", service)
        assert answer.status == 200
        addresses = [
            node.get("location")
            for node in etree.fromstring(wsdl).iter("{http://schemas.xmlsoap.org/wsdl/soap/}address")
        ]
        assert addresses == [f"http://{robot.soap.netloc}/turtlesim_{service}_ws"]
    assert "/robot/pose/" in json.loads(robot.ask("GET", "/openapi.json")[1])["paths"]
    assert etree.fromstring(robot.ask("GET", "/application.wadl")[1]).tag.endswith("application")


def test_legacy_is_as_lenient_as_java(legacy):
    assert legacy.ask("PUT", DELIVERY.format(7, "NaN"))[0].status == 204
    assert legacy.ask("PUT", DELIVERY.format(3, "0x1p3"))[0].status == 204
    assert legacy.ask("PUT", DELIVERY.format(3, "here"))[0].status == 404
    answer, envelope = legacy.call("ExecuteCoffeeRequest", "<arg0><depot_x>far</depot_x><other/></arg0>")
    assert (answer.status, body_of(envelope).tag) == (200, f"{{{TNS}}}ExecuteCoffeeRequestResponse")
    answer, envelope = legacy.call("Dance")
    assert (answer.status, body_of(envelope).findtext("faultcode")) == (500, "S:Client")
    assert etree.fromstring(legacy.describe("xsd=1")[1]).tag == "{http://www.w3.org/2001/XMLSchema}schema"


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
