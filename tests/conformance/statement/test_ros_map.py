"""A ROS map is read as it stands, and refused with the offending value."""

import tomllib

import pytest

from conformance.contract.toml_file import TomlFileError
from conformance.statement.ros_map import Acts, Calls, Failure, Lists, Parameter, Publishes, Reads, read_ros_map

FULL = """
domain_id = 7
non_finite = "null"
integers = "string"
bytes = "base64"

[operations]
"GET /api/v1/pose" = { topic = "/odom", type = "nav_msgs/msg/Odometry", absent = [404, 503], max_age_s = 2.0 }
"POST /api/v1/speed?x={x}" = { publishes = "/cmd_vel", type = "geometry_msgs/msg/Twist", in_url = { x = "/linear/x" } }
"PUT /params/speed" = { parameter = "speed", node = "/base", type = "double", at = "/value" }
"POST /Port/GetSpeed" = { parameter = "speed", node = "/base", type = "double", sets = false }
"POST /api/v1/reset" = { service = "/reset", type = "std_srvs/srv/SetBool", failure = { at = "/ok", values = [false] } }
"GET /api/v1/topics" = { lists = "topics", at = "/topics", name = "/name", type = "/type" }

[operations."POST /api/v1/goals"]
action = "/count"
type = "example_interfaces/action/Fibonacci"
at = "/goal"
id = "/id"
state = { read = "GET /api/v1/goals/{id}", at = "/state", succeeded = ["succeeded"], running = ["executing"] }
feedback = "/feedback"
result = "/result"
cancel = "POST /api/v1/goals/{id}/cancel"
"""


def _read(text):
    return read_ros_map(tomllib.loads(text), "gateway.toml", TomlFileError)


def test_a_full_map():
    ros = _read(FULL)
    assert [type(one) for one in ros.operations.values()] == [
        Reads,
        Publishes,
        Parameter,
        Parameter,
        Calls,
        Lists,
        Acts,
    ]
    assert (ros.domain, ros.non_finite, ros.integers, ros.bytes) == (7, "null", "string", "base64")
    assert ros.operations["GET /api/v1/pose"].absent == (404, 503)
    assert ros.operations["POST /api/v1/reset"].failure == Failure("/ok", (False,))
    assert {one.timeout_s for one in ros.operations.values() if not isinstance(one, Lists)} == {None}
    assert "POST /api/v1/goals/{id}/cancel" in ros.calls
    assert "GET /api/v1/goals/{id}" in ros.calls


def test_a_stream_is_an_operation_of_its_own():
    stream = '"GET /pose/{} = {{ topic = "/odom", type = "nav_msgs/msg/Odometry", stream = "{}", throttle_s = 0.5 }}'
    lines = [stream.format('events?every=500"', "sse"), stream.format('socket"', "websocket")]
    ros = _read("[operations]\n" + "\n".join(lines))
    assert [(one.stream, one.throttle_s) for one in ros.operations.values()] == [("sse", 0.5), ("websocket", 0.5)]
    assert ros.describable == ("GET /pose/events",)


def test_the_domain_is_that_of_the_environment(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    ros = _read(FULL.replace("domain_id = 7", ""))
    assert ros.domain == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", "41")
    assert ros.domain == 41


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("domain_id = 7", "domain_id = 233", "domain_id = 233 must be a whole number from 0 to 232"),
        ('"null"', '"nan"', "non_finite = 'nan' must be one of"),
        ('topic = "/odom"', 'topic = "odom"', "topic = 'odom' must be a full ROS name"),
        ("nav_msgs/msg/Odometry", "nav_msgs/Odometry", "type = 'nav_msgs/Odometry' must be a message type such as"),
        ("absent = [404, 503]", "absent = [200]", "must be a whole number from 400 to 599"),
        ('topic = "/odom"', 'topics = "/odom"', "one key of topic, publishes, service, action, parameter, lists must"),
        ("POST /api/v1/speed?x={x}", "PUT /v?x={y}", "in_url has 'x', but the path and query have no {x}"),
        ("absent = [404, 503]", 'in_url = { x = "/child" }', "in_url is of a request that sends a message; topic"),
        ('topic = "/odom"', 'topic = "/odom", service = "/a"', "it has topic and service"),
        ("values = [false]", "value = [false]", "unknown key 'value'"),
        ("max_age_s", "max_age", "unknown key 'max_age'; known are"),
        ("goals/{id}/cancel", "goals/cancel", "must name what it is about by {id}, or its body must"),
        ('"GET /api/v1/pose"', '"DELETE /api/v1/pose"', "is read by GET"),
        ('"GET /api/v1/pose"', '"pose"', "must be a method and a path"),
        ("GET /api/v1/goals/{id}", "GET /api/v1/goals", "state.read = 'GET /api/v1/goals' must name"),
        ("max_age_s = 2.0", 'stream = "tcp"', "stream = 'tcp' must be one of"),
    ],
)
def test_what_is_wrong_is_named(old, new, said):
    assert old in FULL
    with pytest.raises(TomlFileError) as error:
        _read(FULL.replace(old, new))
    assert said in str(error.value)
    assert "gateway.toml: [ros" in str(error.value)


def test_one_goal_at_a_time_needs_no_id():
    text = FULL.replace("/{id}", "").replace('id = "/id"', "")
    assert _read(text).operations["POST /api/v1/goals"].cancel == "POST /api/v1/goals/cancel"
