"""What one robot does over REST and SOAP, seen by clients and by the robot behind it."""

import asyncio
import contextlib
import json
import select
import socket
import time
from urllib.parse import unquote

import pytest
from lxml import etree
from web_messages import delivery_envelope, delivery_path, fault_of, goal, query_envelope, twist
from web_robot import ForeignRobot, Served, eventually, problem, running_robot

from reference_robot.webservices.configuration import WebSettings
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.robot.velocity import Velocity

# What ROS publishes is what both interfaces show, in every format.

POSE = "/robot/pose/"


def published(served: Served, foreign: ForeignRobot, x: float) -> None:
    foreign.do(odometry={"x": x, "covariance": 1e-05})
    eventually(lambda: served.call("GET", POSE).json()["pose"]["pose"]["position"]["x"] == x)


def test_odometry_of_a_foreign_node_is_the_pose(served, foreign):
    published(served, foreign, 0.1)
    pose = served.call("GET", POSE).json()
    assert list(pose) == ["header", "child_frame_id", "pose", "twist"]
    assert (pose["header"]["frame_id"], pose["child_frame_id"]) == ("odom", "base_link")
    assert (pose["pose"]["covariance"], len(pose["twist"]["covariance"])) == ([0.0] * 35 + [1e-05], 36)
    later = eventually(lambda: (new := served.call("GET", POSE).json())["header"] != pose["header"] and new)
    assert later["header"]["stamp"] != pose["header"]["stamp"]


def test_before_the_first_odometry_there_is_503(domain_id):
    with ForeignRobot(domain_id, "Twist", "silent") as silent, running_robot(domain_id, "--attach") as served:
        for path in (POSE, "/robot/velocity/", "/robot/velocity/linear/"):
            problem(served.call("GET", path), 503)
        assert fault_of(served.soap(query_envelope("GetPose"), url=served.subscribers)) == "Server"
        silent.do(odometry={"x": 2.0, "covariance": 0.0})
        eventually(lambda: served.call("GET", POSE).status_code == 200)
        # A value that is not finite never leaves.
        silent.do(odometry={"x": 2.0, "covariance": float("nan")})
        refused = eventually(lambda: (a := served.call("GET", POSE)).status_code == 503 and a)
        assert "covariance[35] is nan" in refused.json()["detail"]
        assert fault_of(served.soap(query_envelope("GetPose"), url=served.subscribers)) == "Server"
        silent.do(odometry={"x": float("inf"), "covariance": 0.0})
        refused = eventually(lambda: (a := served.call("GET", "/robot/velocity/")).status_code == 503 and a)
        assert "linear.x is inf" in refused.json()["detail"]


# PUT velocity: what reaches cmd_vel, and what is refused and does not.

VELOCITY = "/robot/velocity/"
LINEAR = "/robot/velocity/linear/"
GOAL = "/robot/navigation/action/goal/"


def test_put_is_published_once_and_answered_with_what_was_accepted(served, foreign):
    answer = served.call("PUT", VELOCITY, json=twist(x=0.5, z=-1))
    assert (answer.status_code, answer.json()) == (200, twist(x=0.5, z=-1.0))
    assert foreign.next("velocity") == {"type": "Twist", "x": 0.5, "z": -1.0}
    assert foreign.heard_nothing()


def test_what_another_body_cannot_drive_is_refused(domain_id, tmp_path):
    config = tmp_path / "robot.toml"
    config.write_text("[web]\nmax_reverse = 0\nmax_lateral = 0.3\nmin_radius = 0.5\nlag = 0.01\n")
    aside = twist() | {"linear": {"x": 0.0, "y": -0.3, "z": 0.0}}
    with (
        ForeignRobot(domain_id, "Twist") as foreign,
        running_robot(domain_id, "--attach", f"--config={config}") as served,
    ):
        eventually(lambda: served.call("PUT", VELOCITY, json=aside).status_code == 200)
        assert served.call("PUT", VELOCITY, json=twist(x=0.6, z=1.1)).status_code == 200
        eventually(lambda: foreign.next("velocity")["x"] == 0.6)
        for value, name in (
            (twist(x=-0.1), "linear.x"),
            (twist(x=0.0, z=0.1), "angular.z"),
            (twist(x=0.6, z=1.3), "angular.z"),
        ):
            assert name in problem(served.call("PUT", VELOCITY, json=value), 422)
        # The angular part that is in force counts as well.
        assert "angular.z" in problem(served.call("PUT", LINEAR, json={"x": 0.5, "y": 0.0, "z": 0.0}), 422)
        assert foreign.heard_nothing()


def test_a_robot_that_takes_stamped_twists_gets_them(domain_id):
    with ForeignRobot(domain_id, "TwistStamped") as stamped, running_robot(domain_id, "--attach") as served:
        eventually(lambda: served.call("PUT", VELOCITY, json=twist(x=0.3, z=0.2)).status_code == 200)
        assert stamped.next("velocity") == {"type": "TwistStamped", "x": 0.3, "z": 0.2}


def test_without_a_robot_commands_are_not_accepted(domain_id):
    with running_robot(domain_id, "--attach") as served:
        for answer in (
            served.call("PUT", VELOCITY, json=twist()),
            served.call("PUT", GOAL, json=goal()),
            served.call("PUT", "/robot/app/delivery/4/depot_x/1/depot_y/1/dest_x/1/dest_y/1/source_x/1/source_y/1"),
            served.call("GET", "/robot/navigation/service/plan?x=1&y=1"),
        ):
            problem(answer, 503)
        for path in ("/robot/app/delivery/", "/robot/sensors/", "/robot/navigation/services/"):
            assert served.call("GET", path).json() == []


class BusyMiddleware:
    """Middleware that does not accept the second message and the two after it in time, as on a loaded machine."""

    def __init__(self):
        self.sent = []
        self.accepted = asyncio.Event()

    def find_velocity_subscribers(self):
        return True

    def publish_velocity(self, message):
        self.sent.append(message.linear.x)
        if len(self.sent) == 5:
            self.accepted.set()
        return len(self.sent) not in {2, 3, 4}

    def await_velocity_taken(self):
        """Do nothing."""


@pytest.mark.parametrize("ended_by", ["client", "watchdog", "end of the process"])
def test_a_stop_that_the_middleware_does_not_accept_is_sent_again(ended_by):
    middleware = BusyMiddleware()
    velocity = Velocity(middleware, None, WebSettings(hold=0.05 if ended_by == "watchdog" else 60.0), lambda: False)

    async def drive_and_stop():
        await velocity.command(twist(x=0.1))
        if ended_by == "client":
            await velocity.command(twist(x=0.0))
        if ended_by == "watchdog":
            await asyncio.wait_for(middleware.accepted.wait(), 60)

    asyncio.run(drive_and_stop())
    if ended_by == "end of the process":
        velocity.close()
    assert middleware.sent == [0.1, 0.0, 0.0, 0.0, 0.0]


def test_a_velocity_that_the_middleware_does_not_accept_is_503():
    velocity = Velocity(BusyMiddleware(), None, WebSettings(), lambda: False)

    async def drive():
        await velocity.command(twist(x=0.1))
        await velocity.command(twist(x=0.2))

    with pytest.raises(Problem, match="fast enough"):
        asyncio.run(drive())


# The life of a goal, seen by an action server of another process.


def _last_goal(served):
    answer = served.call("GET", GOAL)
    return answer.status_code == 404 and answer.json().get("last_goal")


def test_without_a_goal_the_robot_tells_how_the_last_one_ended(served, foreign):
    for number, (end, status) in enumerate(
        [(lambda: foreign.do(finish=True), (4, "succeeded")), (lambda: served.call("DELETE", GOAL), (5, "canceled"))]
    ):
        served.call("PUT", GOAL, json=goal(f"goal {number}"))
        foreign.next("goal")
        end()
        last = eventually(lambda: _last_goal(served))
        assert (last["goal_id"]["id"], tuple(last["status"].values())) == (f"goal {number}", status)
    as_xml = etree.fromstring(served.call("GET", GOAL, headers={"Accept": "application/xml"}).content)
    assert as_xml.findtext("{*}last_goal/{*}status/{*}text") == "canceled"


def told(identity: str) -> dict[str, object]:
    pose = goal(x=7.0)["goal"]["target_pose"] | {"header": {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": "map"}}
    return {"goal_id": identity, "status": 2, "pose": pose}


def test_a_mission_s_goal_is_shown_and_cancelled(served, foreign):
    foreign.do(current_goal=told("ab" * 16))
    shown = eventually(lambda: (answer := served.call("GET", GOAL)).is_success and answer.json())
    assert shown["goal_id"] == {"stamp": {"sec": 5, "nanosec": 6}, "id": "ab" * 16}
    assert shown["goal"]["target_pose"]["pose"]["position"]["x"] == 7.0
    assert served.call("PUT", "/robot/velocity/", json=twist()).status_code == 409
    assert served.call("DELETE", GOAL).status_code == 204
    assert served.call("GET", GOAL).status_code == 404
    foreign.do(current_goal={})


def test_a_goal_of_ours_is_never_taken_for_a_mission_s(served, foreign):
    """The robot's word on its current goal may lag behind: here it stays with a goal that was displaced."""
    foreign.do(tell_next_goal_as=told(""))
    assert served.call("PUT", GOAL, json=goal("first")).status_code == 201
    foreign.next("goal")
    assert served.call("PUT", GOAL, json=goal("second", x=5.0)).status_code == 202
    foreign.next("goal")
    assert served.call("DELETE", GOAL).status_code == 204
    assert served.call("GET", GOAL).status_code == 404
    foreign.forget_until("cancel")
    foreign.do(current_goal={})


@pytest.mark.parametrize("report", ["", [], {"goal_id": "x"}, {"goal_id": "x", "status": "2", "pose": {}}, 7])
def test_a_report_amiss_is_no_goal(served, foreign, report):
    foreign.do(current_goal=report)
    foreign.do(odometry={"x": 4.0, "covariance": 0.0})
    eventually(lambda: served.call("GET", "/robot/velocity/").json()["linear"]["x"] == 0.4)
    assert served.call("GET", GOAL).status_code == 404
    foreign.do(odometry={"x": 1.0, "covariance": 0.0})


# One accepted request is exactly one message, every double bit for bit the one that was sent.


def test_the_list_holds_the_last_50_and_is_bounded(served, foreign):
    for number in range(120):
        assert served.call("PUT", delivery_path(source_x=number)).status_code == 204
    for _ in range(120):
        foreign.next("delivery")
    listed = served.call("GET", "/robot/app/delivery/").json()
    assert 50 <= len(listed) <= 100
    assert [entry["request"]["source_x"] for entry in listed[:50]] == [float(119 - place) for place in range(50)]


# Messages and faults, by SOAP 1.1 and the WS-I Basic Profile 1.1; the services' descriptions.


@pytest.mark.parametrize(
    ("name", "sent"),
    [
        ("depot_x", "INF"),
        ("depot_y", "-INF"),
        ("source_x", "NaN"),
        ("source_y", "1e400"),
        ("destination_x", "1e400"),
        ("destination_y", "-INF"),
        ("depot_x", "9" * 400),
        ("message_code", "5"),
        ("message_code", "+05"),
        ("message_code", "0" * 5000 + "4"),
    ],
)
def test_a_value_that_no_delivery_may_have_is_named_and_repeated(served, foreign, name, sent):
    answer = served.soap(delivery_envelope(**{name: sent}))
    assert fault_of(answer) == "Client"
    told = etree.fromstring(answer.content).findtext(".//faultstring")
    assert told.startswith(f"{name} must be ")
    assert f"not '{sent[:7]}" in told
    assert len(told) < 300
    assert foreign.heard_nothing()


def test_must_understand_is_0_or_1(served):
    header = '<s:Header><x:token xmlns:x="urn:x" s:mustUnderstand="true"/></s:Header>'
    assert fault_of(served.soap(delivery_envelope(header=header))) == "Client"


@pytest.mark.parametrize("sent", ["1e400", "9" * 400])
def test_a_plan_query_s_number_is_repeated(served, sent):
    answer = served.soap(query_envelope("GetPlan", f"<x>{sent}</x><y>1</y>"), url=served.subscribers)
    assert fault_of(answer) == "Client"
    told = etree.fromstring(answer.content).findtext(".//faultstring")
    assert told.startswith(f"x must be finite, not '{sent[:5]}")
    assert len(told) < 300


# Bad input is refused with a 4xx that names it, reaches no robot, and the next good request is answered.

GOOD = json.dumps(twist())

XML = "<Twist><linear><x>{}</x><y>0</y><z>0</z></linear><angular><x>0</x><y>0</y><z>0</z></angular></Twist>"


def refused(served: Served, foreign: ForeignRobot, answer, status: int) -> None:
    assert problem(answer, status)
    assert "Traceback" not in answer.text
    assert len(answer.content) < 2000
    # What comes next over ROS is the next good request: the bad one reached nobody.
    assert served.call("PUT", VELOCITY, json=twist(x=0.123)).status_code == 200
    assert foreign.next("velocity")["x"] == 0.123


BAD_PARTS = {
    "code": ["coffee", "4.0", "", "5", "0", "-4", "+0007", "4294967300", "9" * 5000],
    "depot_x": ["abc", ""],
    "depot_y": ["NaN", "%31e400"],
    "dest_x": ["Infinity", "-inf", "1e400", "NaN"],
    "dest_y": ["1e400", "-1E+999"],
    "source_x": ["1_0", "0x10", "1,5", "9" * 400],
    "source_y": ["1.", "%D9%A1", "1%20", "%00"],
}


@pytest.mark.parametrize(("name", "sent"), [(name, value) for name, values in BAD_PARTS.items() for value in values])
def test_deliveries_with_bad_values_are_422(served, foreign, name, sent):
    """The refusal names the part of the path, and repeats it as it was sent."""
    answer = served.call("PUT", delivery_path(**{name: sent}))
    refused(served, foreign, answer, 422)
    told = answer.json()["detail"]
    assert told.startswith(f"{name} must be ")
    assert f"not {ascii(unquote(sent))[:100]}" in told
    assert len(told) < 300
    assert served.call("PUT", delivery_path(source_x=0.5)).status_code == 204
    assert foreign.next("delivery")["source_x"] == "3fe0000000000000"


@pytest.mark.parametrize("sent", ["1e400", "-1E+999", "2" * 309])
@pytest.mark.parametrize(("media_type", "document"), [("application/json", GOOD), ("application/xml", XML.format(0.1))])
def test_a_body_s_number_is_repeated_as_it_was_sent(served, foreign, media_type, document, sent):
    headers = {"Content-Type": media_type}
    answer = served.call("PUT", VELOCITY, content=document.replace("0.1", sent), headers=headers)
    refused(served, foreign, answer, 422)
    assert answer.json()["detail"].startswith("linear.x must be a finite number, not ")
    assert sent[:100] in answer.json()["detail"]


# Clients that send half a request, vanish, or come in hundreds.

BODY = b'{"linear": {"x": 0.1, "y": 0, "z": 0},'
HALVES = {
    "nothing": b"",
    "half a method": b"PU",
    "half a target": b"GET /robot/po",
    "half a field": b"GET /robot/pose/ HTTP/1.1\r\nHost: ro",
    "no end of the head": b"GET /robot/pose/ HTTP/1.1\r\nHost: robot\r\n",
    "half a body": b"PUT /robot/velocity/ HTTP/1.1\r\nHost: robot\r\nContent-Type: application/json\r\n"
    b"Content-Length: 200\r\n\r\n" + BODY,
    "half a chunk": b"PUT /robot/velocity/ HTTP/1.1\r\nHost: robot\r\nContent-Type: application/json\r\n"
    b"Transfer-Encoding: chunked\r\n\r\n40\r\n" + BODY,
}


def test_half_a_request_is_given_up(served):
    with contextlib.ExitStack() as stack:
        waiting = {}
        for name, half in HALVES.items():
            for soap in (False, True):
                connection = stack.enter_context(served.connection(soap=soap))
                posted = half.replace(b"PUT /robot/velocity/", b"POST /turtlesim_publisher_ws")
                connection.sendall(posted.replace(b"application/json", b"text/xml") if soap else half)
                waiting[f"{name}, {'soap' if soap else 'rest'}"] = connection
        time.sleep(0.5)  # half of the deadline that the fixture sets
        assert [name for name, connection in waiting.items() if is_readable(connection)] == []
        for name, connection in waiting.items():
            connection.settimeout(60)
            answer = b""
            with contextlib.suppress(ConnectionResetError):
                while received := connection.recv(65536):
                    answer += received
            assert answer == b"" or answer.startswith(b"HTTP/1.1 408 "), name
    assert served.call("GET", "/robot/pose/").status_code == 200


def is_readable(connection: socket.socket) -> bool:
    return bool(select.select([connection], [], [], 0)[0])


def test_an_offer_of_http_2_is_ignored_and_the_content_read(served, foreign):
    """As Java's HttpClient sends its first request."""
    body = delivery_envelope().encode()
    answer = served.raw(
        b"POST /turtlesim_publisher_ws HTTP/1.1\r\nConnection: Upgrade, HTTP2-Settings, close\r\n"
        b"Content-Length: %d\r\nHost: robot\r\nHTTP2-Settings: AAEAAEAAAAIAAAABAAMAAABk\r\nUpgrade: h2c\r\n"
        b"Content-Type: text/xml\r\n\r\n%b" % (len(body), body),
        soap=True,
    )
    assert answer.startswith(b"HTTP/1.1 200 ")
    foreign.next("delivery")


def test_500_connections_at_once(served):
    request = b"GET /robot/pose/ HTTP/1.1\r\nHost: robot\r\nConnection: close\r\n\r\n"
    with contextlib.ExitStack() as stack:
        connections = [stack.enter_context(served.connection()) for _ in range(500)]
        for connection in connections:
            connection.settimeout(60)
            connection.sendall(request)
        assert all(connection.recv(100).startswith(b"HTTP/1.1 200 ") for connection in connections)
